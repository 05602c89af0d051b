"""Every effect of the catalogue tried beside a model: its regressors, and how strong the evidence has to be.

A linear effect's regressor is its analytic slope along the trajectory; one with a memory, a delay or a threshold is
tried at a few sizes, its regressor the difference that this size makes.

Under a model that lacks nothing, twice the gain in log-likelihood is chi-square with as many degrees of freedom as the
effect has coefficients (Wilks); the best of N independent places exceeds x with probability 1 - (1 - p(x))^N. What is
not independent is counted by its resolution: onsets a decay apart, frequencies a line apart. Healthy simulated wheels
follow this law but for a factor, because crossings of zero speed are not perfectly Gaussian (`python -m
tools.proof.prove --only healthy`, docs/diagnosis-proof.md).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from rw_ekf.arrays import Complex128Array, Float64Array
from rw_ekf.diagnosis.thresholds import INFLATION, SIGNIFICANT_P
from rw_ekf.filter.tails import chi_square_tail
from rw_ekf.likelihood.linearisation import Linearisation
from rw_ekf.likelihood.one_step import predict
from rw_ekf.likelihood.whitening import adjoint
from rw_ekf.likelihood.work_budget import screening_units
from rw_ekf.model.effect import Candidate, Effect, RecordFacts, Term
from rw_ekf.model.effect_kinds import LawEffect, StaticEffect
from rw_ekf.wheel.effect_table import EffectSet

_USUAL_SIZE = 10.0  # of the smallest that matters: as large as effects of wheels are, to an order of magnitude
_CHUNK, _LEAST_CHUNK = 128, 16
_CELLS = 1_600_000  # of a chunk's columns: 13 MB, of which four copies are held; a chunk is 128 up to 12,500 samples
_FEW = 16  # hypotheses of a pass each that are whitened together
_SCREENED = 24
_NEIGHBOURS = 41
_BLOCK, _BLOCKS = 64, 8  # neighbouring frequencies, and blocks of them that share a product
_FEW_PLACES = 16  # of a block: with less of them the rest is not worked out
_EVEN = 1.0e-9  # of their spacing


def p_value(effect: type[Effect], statistic: float, facts: RecordFacts, freedom: int | None = None) -> float:
    """Probability that a wheel without the effect shows as much; freedom: coefficients, where they vary."""
    if statistic <= 0.0:
        return 1.0
    single = chi_square_tail(statistic / INFLATION, freedom or effect.components)
    return float(-math.expm1(_places(effect, facts) * math.log1p(-single))) if single < 1.0 else 1.0


@lru_cache(maxsize=256)
def _places(effect: type[Effect], facts: RecordFacts) -> float:
    """Independent places of an effect, counted once a record: it may have a thousand frequencies to list."""
    return effect.places(facts)


def threshold(effect: type[Effect], facts: RecordFacts, p: float = SIGNIFICANT_P) -> float:
    """Statistic whose p-value is p, by bisection."""
    low, high = 0.0, 400.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        if p_value(effect, middle, facts) > p:
            low = middle
        else:
            high = middle
    return high


@dataclass(frozen=True)
class Score:
    """What an effect would add at its best place: 2 (L_with - L_without), each at its own best noises."""

    effect: type[Effect]
    candidate: Candidate
    statistic: float
    p_value: float
    screening_gain: float  # log-likelihood, averaged over all its places and sizes: ranks what is to be fitted
    size: float  # the coefficient in its unit; the amplitude of sine and cosine
    std: float
    starts: tuple[Term, ...]  # where fits of the effect begin


@dataclass(eq=False, frozen=True)
class Hypothesis:
    """One place to look for one effect, with its regressors (n, 1 or 2), for coefficients of `unit` each."""

    effect: type[Effect]
    candidate: Candidate
    regressors: Float64Array
    unit: float

    def screening_gain(self, statistic: float, std: Float64Array, facts: RecordFacts) -> float:
        """Log of the likelihood gained here, averaged over the sizes that the effect may have; std (1 or 2,)."""
        width = _USUAL_SIZE * self.effect.smallest(facts) / self.unit
        return 0.5 * statistic / INFLATION - 0.5 * float(np.sum(np.log1p((width / std) ** 2)))

    def scored(
        self, statistic: float, screening_gain: float, coefficients: Float64Array, std: Float64Array, facts: RecordFacts
    ) -> Score:
        """What a regression on the regressors gave: coefficients and standard deviations (1 or 2,)."""
        found = tuple(float(value) * self.unit for value in coefficients)
        if self.effect.linear:
            starts = [replace(Term.at(self.effect, self.candidate), values=found)]
        else:
            starts = [Term.at(self.effect, start) for start in self.effect.starts(self.candidate, found[0])]
        return Score(
            effect=self.effect,
            candidate=self.candidate,
            statistic=statistic,
            p_value=p_value(self.effect, statistic, facts),
            screening_gain=screening_gain,
            size=float(np.linalg.norm(coefficients)) * self.unit,
            std=float(np.linalg.norm(std)) * self.unit,
            starts=tuple(starts),
        )


def hypotheses(
    linearised: Linearisation,
    places: list[tuple[type[Effect], Candidate]],
) -> Iterator[list[Hypothesis]]:
    """Columns of every place where an effect is sought, in chunks that share a pass."""
    static: list[tuple[type[Effect], Candidate]] = []
    secants: list[Hypothesis] = []
    for effect, candidate in places:
        if issubclass(effect, StaticEffect) and effect.linear:
            static.append((effect, candidate))
            continue
        found = _secant(linearised, effect, candidate)
        if found is not None:
            secants.append(found)
        if len(secants) == _FEW:
            yield secants
            secants = []
    if secants:
        yield secants
    at_once = places_at_once(linearised.chain.reading.size)
    for first in range(0, len(static), at_once):
        yield analytic(linearised, static[first : first + at_once])


def places_at_once(samples: int) -> int:
    """How many columns of so many samples share a pass."""
    return min(max(_CELLS // max(samples, 1), _LEAST_CHUNK), _CHUNK)


def analytic(linearised: Linearisation, places: list[tuple[type[Effect], Candidate]]) -> list[Hypothesis]:
    """Slopes of all places at once. Effects without written slopes are left out of the model meanwhile."""
    model = linearised.model
    kept = [term for term in model.terms if issubclass(term.effect, (StaticEffect, LawEffect))]
    tried = [Term.of(effect, candidate.shape) for effect, candidate in places]
    effects = EffectSet((*kept, *tried))
    coefficients = np.array([*model.parameters, *effects.values])
    rows = predict(
        linearised.record,
        coefficients,
        effects,
        model.stribeck,
        linearised.trajectory,
        with_rows=True,
        with_slopes=False,
    ).rows
    found, at = [], 1 + coefficients.size - sum(len(term.values) for term in tried)
    for (effect, candidate), term in zip(places, tried, strict=True):
        regressors = np.ascontiguousarray(rows[:, at : at + len(term.values)])
        found.append(Hypothesis(effect, candidate, regressors, 1.0))
        at += len(term.values)
    return found


def _secant(linearised: Linearisation, effect: type[Effect], candidate: Candidate) -> Hypothesis | None:
    """The difference that an effect of this size makes; None where the model already has one like it."""
    model = linearised.model
    if model.of(effect.id):
        return None
    model_with = model.with_terms(Term.at(effect, candidate))
    try:
        ends = predict(
            linearised.record, model_with.coefficients, model_with.effects, model.stribeck, linearised.trajectory,
            with_slopes=False,
        ).end  # fmt: skip
    except ZeroDivisionError:
        return None
    change = np.where(linearised.record.follows, ends - linearised.chain.defect - linearised.trajectory.speed, 0.0)
    if not np.isfinite(change).all() or not change.any():
        return None
    return Hypothesis(effect, candidate, change[:, None], candidate.amplitude)


def screened(
    candidates: list[Candidate], linearised: Linearisation, left: list[tuple[float, Float64Array]], variance: float
) -> list[Candidate]:
    """The frequencies worth an exact score: those of most power in the adjoint of what is left (eq. 9).

    left: ratios of noises, each with what the model leaves at it, whitened, (n,), zero where there is no innovation.
    The power's denominator changes slowly with frequency, so that comparing neighbours needs none.
    """
    if len(candidates) <= _SCREENED:
        return candidates
    chain = linearised.chain
    middle = linearised.record.course.time_s - 0.5 * chain.step_s
    frequency = np.array([candidate.shape[0] for candidate in candidates])
    chosen: set[int] = set()
    moving = np.zeros((len(left), chain.reading.size))
    for at, (ratio, white) in enumerate(left):
        back = np.zeros(chain.reading.size)
        adjoint(chain, ratio * variance / linearised.record.period_s, variance, white, back)
        moving[at] = back * chain.step_s * (chain.slopes[:, 0] != 0.0)
    linearised.record.work.charge(screening_units(middle.size, frequency.size))
    # A torque moves the speed by one over its frequency.
    for power in powers(frequency, middle, moving) * (frequency**2 + frequency[0] ** 2):
        level = np.maximum(np.convolve(power, np.ones(_NEIGHBOURS), "same"), 1.0e-300)
        chosen |= {int(j) for j in np.argsort(power / level)[-_SCREENED // 2 :]}
        chosen |= {int(j) for j in np.argsort(power)[-_SCREENED // 2 :]}
    return [candidates[j] for j in sorted(chosen)]


def powers(frequency_Hz: Float64Array, time_s: Float64Array, values: Float64Array) -> Float64Array:
    """Power (k, m) of k series (k, n) at times (n,) in m frequencies [Hz], rising.

    Multiples of the smallest step between them, if the first is one, share two tables of phasors, of 64 neighbours and
    of every 64th: a product in place of an exponential.
    """
    used = np.any(values != 0.0, axis=0)
    time, series = time_s[used] - time_s[0], values[:, used].T.astype(np.complex128)
    power = np.empty((values.shape[0], frequency_Hz.size))
    step = float(np.min(np.diff(frequency_Hz), initial=frequency_Hz[0]))
    step = float(frequency_Hz[0]) / round(frequency_Hz[0] / step)  # a difference has lost digits
    multiple = np.rint(frequency_Hz / step).astype(np.int64)
    on_grid = np.abs(frequency_Hz - step * multiple) < _EVEN * step
    for j in np.flatnonzero(~on_grid):
        power[:, j] = np.abs(np.exp(-2j * math.pi * frequency_Hz[j] * time) @ series) ** 2
    neighbours = np.exp(-2j * math.pi * step * np.outer(np.arange(_BLOCK), time))
    blocks, places = np.divmod(multiple, _BLOCK)
    inside = {int(b): np.flatnonzero(on_grid & (blocks == b)) for b in np.unique(blocks[on_grid])}

    def turned(number: int) -> Complex128Array:
        phasors: Complex128Array = np.exp(-2j * math.pi * step * _BLOCK * number * time)
        return series * phasors[:, None]

    for number, at in inside.items():
        if at.size <= _FEW_PLACES:
            power[:, at] = (np.abs(neighbours[places[at]] @ turned(number)) ** 2).T
    dense = [number for number, at in inside.items() if at.size > _FEW_PLACES]
    for first in range(0, len(dense), _BLOCKS):  # a product with many columns takes hardly longer than one with two
        numbers = dense[first : first + _BLOCKS]
        found = neighbours @ np.concatenate([turned(number) for number in numbers], axis=1)
        for number, column in zip(numbers, np.split(found, len(numbers), axis=1), strict=True):
            power[:, inside[number]] = (np.abs(column[places[inside[number]]]) ** 2).T
    return power
