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
from rw_ekf.likelihood.model import columns_of_candidate
from rw_ekf.likelihood.one_step import predict
from rw_ekf.model.effect import Candidate, Effect, RecordFacts, StaticEffect
from rw_ekf.wheel.table import Column, EffectSet

_CHUNK = 128


@dataclass(frozen=True)
class Hypothesis:
    """One place to look for one effect, with its columns on a frame (n, 1 or 2), for coefficients of `unit` each."""

    effect: type[Effect]
    candidate: Candidate
    columns: Float64Array
    unit: float

    def starts(self, coefficients: Float64Array) -> list[list[Column]]:
        """The effect as fits should start: at the regression's coefficients (1 or 2,), or where it was tried."""
        made = columns_of_candidate(self.effect, self.candidate)
        found = [replace(c, value=float(v) * self.unit) for c, v in zip(made, coefficients, strict=True)]
        if self.effect.linear:
            return [found]
        return [columns_of_candidate(self.effect, s) for s in self.effect.starts(self.candidate, found[0].value)]


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
        """The coefficient in its unit; the amplitude of two quadratures."""
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
    kept = [c for c in model.columns if issubclass(c.effect, StaticEffect)]
    tried = [columns_of_candidate(effect, candidate) for effect, candidate in places]
    flat = [replace(column, value=0.0) for columns in tried for column in columns]
    effects = EffectSet((*kept, *flat))
    coefficients = np.array([*model.parameters, *effects.values])
    rows = predict(
        frame.record,
        coefficients,
        effects,
        model.omega_s,
        model.law,
        frame.reference,
        with_rows=True,
        with_slopes=False,
    ).rows
    found, at = [], 1 + coefficients.size - len(flat)
    for (effect, candidate), columns in zip(places, tried, strict=True):
        found.append(Hypothesis(effect, candidate, np.ascontiguousarray(rows[:, at : at + len(columns)]), 1.0))
        at += len(columns)
    return found


def _secant(frame: Frame, effect: type[Effect], candidate: Candidate) -> Hypothesis | None:
    """The difference that an effect of this size makes; None where the model already has one like it."""
    model = frame.model
    if any(column.effect is effect for column in model.columns):
        return None
    model_with = model.with_effect(columns_of_candidate(effect, candidate))
    try:
        ends = predict(
            frame.record, model_with.coefficients, model_with.effects, model.omega_s, model.law, frame.reference,
            with_slopes=False,
        ).end  # fmt: skip
    except ZeroDivisionError:
        return None
    change = np.where(frame.record.follows, ends - frame.chain.defect - frame.reference.speed, 0.0)
    if not np.isfinite(change).all() or not change.any():
        return None
    return Hypothesis(effect, candidate, change[:, None], candidate.amplitude)
