"""Every effect of the catalogue tried on a frame: its columns, and what it would add to the likelihood.

A linear effect's column is its analytic slope along the reference; one with a memory, a delay or a threshold is tried
at a few sizes, its column the difference that this size makes. Nothing is refitted here: a candidate's gain is that of
a linear regression, joint with the corrections of everything already in the model, at each of a few ratios of noises
(docs/diagnosis.md, "Evidence").
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.frame import Frame
from rw_ekf.likelihood.one_step import predict
from rw_ekf.model.effect import Candidate, Effect, RecordFacts, Term
from rw_ekf.model.effect_kinds import StaticEffect
from rw_ekf.wheel.table import EffectSet

_CHUNK = 128


@dataclass(frozen=True)
class Hypothesis:
    """One place to look for one effect, with its columns on a frame (n, 1 or 2), for coefficients of `unit` each."""

    effect: type[Effect]
    candidate: Candidate
    columns: Float64Array
    unit: float

    def starts(self, coefficients: Float64Array) -> list[Term]:
        """The effect as fits should start: at the regression's coefficients (1 or 2,), or where it was tried."""
        found = tuple(float(value) * self.unit for value in coefficients)
        if self.effect.linear:
            return [replace(Term.at(self.effect, self.candidate), values=found)]
        return [Term.at(self.effect, start) for start in self.effect.starts(self.candidate, found[0])]


@dataclass(frozen=True)
class Score:
    """What a hypothesis would add: 2 (L_with - L_without), each at its own best noises, and the coefficients found."""

    hypothesis: Hypothesis
    statistic: float
    coefficients: Float64Array
    std: Float64Array

    @property
    def id(self) -> str:
        """The effect's id."""
        return self.hypothesis.effect.id

    @property
    def size(self) -> float:
        """The coefficient in its unit; the amplitude of sine and cosine."""
        return float(np.linalg.norm(self.coefficients)) * self.hypothesis.unit


def testable(facts: RecordFacts) -> dict[str, str | None]:
    """Why each effect cannot be tested on this log; None for those that can."""
    return {name: effect.untestable(facts) for name, effect in CATALOGUE.items()}


def hypotheses(
    frame: Frame,
    places: list[tuple[type[Effect], Candidate]],
) -> Iterator[list[Hypothesis]]:
    """Columns of every place where an effect is sought, in chunks that share a pass."""
    static: list[tuple[type[Effect], Candidate]] = []
    for effect, candidate in places:
        if issubclass(effect, StaticEffect) and effect.linear:
            static.append((effect, candidate))
            continue
        found = _secant(frame, effect, candidate)
        if found is not None:
            yield [found]
    for first in range(0, len(static), _CHUNK):
        yield analytic(frame, static[first : first + _CHUNK])


def analytic(frame: Frame, places: list[tuple[type[Effect], Candidate]]) -> list[Hypothesis]:
    """Slopes of all places at once. Effects without written slopes are left out of the model meanwhile."""
    model = frame.model
    kept = [term for term in model.terms if issubclass(term.effect, StaticEffect)]
    tried = [Term.of(effect, candidate.shape) for effect, candidate in places]
    effects = EffectSet((*kept, *tried))
    coefficients = np.array([*model.parameters, *effects.values])
    rows = predict(
        frame.record,
        coefficients,
        effects,
        model.stribeck,
        frame.reference,
        with_rows=True,
        with_slopes=False,
    ).rows
    found, at = [], 1 + coefficients.size - sum(len(term.values) for term in tried)
    for (effect, candidate), term in zip(places, tried, strict=True):
        columns = np.ascontiguousarray(rows[:, at : at + len(term.values)])
        found.append(Hypothesis(effect, candidate, columns, 1.0))
        at += len(term.values)
    return found


def _secant(frame: Frame, effect: type[Effect], candidate: Candidate) -> Hypothesis | None:
    """The difference that an effect of this size makes; None where the model already has one like it."""
    model = frame.model
    if model.of(effect.id):
        return None
    model_with = model.with_terms(Term.at(effect, candidate))
    try:
        ends = predict(
            frame.record, model_with.coefficients, model_with.effects, model.stribeck, frame.reference,
            with_slopes=False,
        ).end  # fmt: skip
    except ZeroDivisionError:
        return None
    change = np.where(frame.record.follows, ends - frame.chain.defect - frame.reference.speed, 0.0)
    if not np.isfinite(change).all() or not change.any():
        return None
    return Hypothesis(effect, candidate, change[:, None], candidate.amplitude)
