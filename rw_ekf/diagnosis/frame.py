"""A model linearised along the reference, its likelihood with the noises profiled out, and its fit (docs/diagnosis.md).

The noises are never known beforehand, and a model that lacks something pays in process noise. So every comparison of
models is between likelihoods each at its own best ratio of noises, q dt / R; R itself drops out in closed form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rw_ekf.diagnosis.model import Model
from rw_ekf.diagnosis.one_step import Record, Reference, is_differentiable, predict
from rw_ekf.diagnosis.whitening import Chain, smooth, whiten
from rw_ekf.effects.table import ABSENT

Float64Array = NDArray[np.float64]

LEAST_RATIO = (
    1.0e-7  # of q dt to R: over a record of 10^5 samples the speed then wanders by a tenth of a reading's noise
)
_MOST_RATIO = 1.0e2
_STUCK_SHARE = 0.1  # of the speed noise: what a wheel believed at rest may still be off by
_FIT_TURNS = 8
_SETTLING_TURNS = 4
_LEAST_SPREAD = 0.02  # of the speed noise: no reference is known better
_NOT_WORSE = 0.5  # log-likelihood that a step may lose to the reference that moved meanwhile
_LEAST_DAMPING = 0.02
_SMALL_STEP = 0.05  # standard deviations


@dataclass(frozen=True)
class Prior:
    """Weak a priori on the four parameters: mean (4,), and W (4, 4) with W' W the inverse covariance."""

    mean: Float64Array
    root: Float64Array

    @classmethod
    def of(cls, mean: Float64Array, covariance: Float64Array) -> Prior:
        """From a belief over the parameters."""
        return cls(mean, np.linalg.cholesky(np.linalg.inv(covariance)).T)


@dataclass(frozen=True)
class Frame:
    """Predictions of a model along a reference, and their slopes by everything that is fitted; arrays (n, ...)."""

    record: Record
    model: Model
    reference: Reference
    chain: Chain
    columns: Float64Array  # (n, p)
    memory_columns: Float64Array  # (n, p), or (0, p) for a model without a memory

    @property
    def innovation_at(self) -> NDArray[np.intp]:
        """Samples that have an innovation, whatever the noises: those read, but the first of each stretch."""
        n = self.chain.reading.size
        r, none = np.full(n, np.nan), np.zeros((n, 0))
        whiten(self.chain, none, none[:0], 0.0, 1.0, r, none)
        return np.flatnonzero(np.isfinite(r))

    def whitened(
        self, ratio: float, scale: float, columns: Float64Array, memory_columns: Float64Array | None = None
    ) -> tuple[Float64Array, Float64Array, float]:
        """(r, A, sum of log S) at R = scale and q = ratio R / period, over the samples that have an innovation."""
        n, m = columns.shape
        r, A = np.full(n, np.nan), np.zeros((n, m))
        period = self.record.data.period_s
        held = np.zeros((0, m)) if memory_columns is None else memory_columns
        logs = whiten(self.chain, columns, held, ratio * scale / period, scale, r, A)
        used = np.isfinite(r)
        return r[used], A[used], logs


@dataclass(frozen=True)
class Noise:
    """Variance of a reading R [rad^2/s^2] and ratio of process noise, q dt / R."""

    variance: float
    ratio: float


@dataclass(frozen=True)
class Likelihood:
    """Of one model, at its best noises and corrections of its vector."""

    value: float
    noise: Noise
    correction: Float64Array
    covariance: Float64Array
    count: int


def linearise(
    record: Record,
    model: Model,
    reference: Reference,
    noise: Noise,
    omit: NDArray[np.bool_],
    *,
    with_columns: bool = True,
) -> Frame:
    """Predict every interval and differentiate by the model's vector; `omit` (n,) readings are left out."""
    analytic = with_columns and is_differentiable(model.effects) and not model.refined
    centre = predict(record, model.coefficients, model.effects, model.omega_s, model.law, reference, with_rows=analytic)
    with_memory = model.effects.table().memory_state_at != ABSENT
    n = reference.speed.size
    if not with_columns:
        columns, memory_columns = np.zeros((n, 0)), np.zeros((n if with_memory else 0, 0))
    elif analytic:
        columns = np.ascontiguousarray(centre.rows[:, 1:])
        memory_columns = np.zeros((0, columns.shape[1]))
    else:
        columns, memory_columns = _differences(record, model, reference, with_memory=with_memory)
    extra = centre.bend**2
    resting = record.follows & (centre.end == 0.0)
    extra[resting] += _STUCK_SHARE**2 * noise.variance
    if with_memory and np.isnan(reference.memory).any():  # the first time: the memory carried along is its reference
        reference = replace(reference, memory=_before(centre.memory_end, record, reference, model))
    reading = np.where(omit, np.nan, record.data.speed_rad_s - reference.speed)
    chain = Chain(
        record.follows,
        np.where(record.follows, np.diff(record.data.time_s, prepend=record.data.time_s[:1]), 0.0),
        centre.slopes,
        np.where(record.follows, centre.end - reference.speed, 0.0),
        np.where(record.follows, centre.memory_end - reference.memory, 0.0) if with_memory else np.zeros(extra.size),
        extra,
        (0.5 * model.parameters.coulomb) ** 2 if with_memory else 0.0,
        reading,
    )
    return Frame(record, model, reference, chain, columns, memory_columns)


def _before(memory_end: Float64Array, record: Record, reference: Reference, model: Model) -> Float64Array:
    """Memory at each sample as a pass carried it along: its end where an interval led there, else settled or none."""
    settled = np.where(
        np.abs(reference.speed) > model.omega_s, np.copysign(model.parameters.coulomb, reference.speed), 0.0
    )
    return np.where(record.follows, memory_end, settled)


def _differences(
    record: Record, model: Model, reference: Reference, *, with_memory: bool
) -> tuple[Float64Array, Float64Array]:
    """Slopes of speeds and memories by the model's vector, by central differences of whole passes: (n, p) twice."""
    vector = model.vector
    n = reference.speed.size
    columns = np.zeros((n, vector.size))
    memory_columns = np.zeros((n if with_memory else 0, vector.size))
    for j, h in enumerate(_step_sizes(model)):
        ends, moved = [], []
        for sign in (1.0, -1.0):
            point = vector.copy()
            point[j] += sign * h
            there = model.with_vector(point)
            moved.append(there.vector[j])
            ends.append(
                predict(
                    record, there.coefficients, there.effects, model.omega_s, model.law, reference, with_slopes=False
                )
            )
        width = moved[0] - moved[1]
        if width != 0.0:
            columns[:, j] = np.where(record.follows, (ends[0].end - ends[1].end) / width, 0.0)
            if with_memory:
                change = (ends[0].memory_end - ends[1].memory_end) / width
                memory_columns[:, j] = np.where(record.follows, change, 0.0)
    return columns, memory_columns


def _step_sizes(model: Model) -> list[float]:
    k, _, c, s = model.parameters
    sizes = [1.0e-3 * abs(k), 1.0e-3 * c, 1.0e-3 * c, 1.0e-3 * max(s, c)]
    sizes[1] = max(1.0e-3 * abs(model.parameters.viscous), 1.0e-6)
    sizes += [0.02 * abs(column.value) if column.value != 0.0 else 1.0e-3 * c for column in model.columns]
    sizes += [0.02 * abs(model.columns[i].shape[j]) for i, j in model.refined]
    for at, (i, j) in enumerate(model.refined, start=4 + len(model.columns)):
        if model.columns[i].effect.constants[j].unit == "Hz":
            sizes[at] = 1.0e-4 * abs(model.columns[i].shape[j])
        elif model.columns[i].effect.constants[j].name == "onset_s":
            sizes[at] = 0.5
    return sizes


def likelihood(frame: Frame, prior: Prior | None, noise: Noise, *, fixed_ratio: bool = False) -> Likelihood:
    """Maximise over corrections of the vector, R and the ratio of noises; start from `noise`."""
    from scipy.optimize import minimize_scalar

    found: dict[float, Likelihood] = {}

    def negative(log_ratio: float) -> float:
        ratio = math.exp(log_ratio)
        found[log_ratio] = _at_ratio(frame, prior, noise.variance, ratio)
        return -found[log_ratio].value

    if fixed_ratio:
        return _at_ratio(frame, prior, noise.variance, noise.ratio)
    low, high = math.log(LEAST_RATIO), math.log(_MOST_RATIO)
    minimize_scalar(negative, bounds=(low, high), method="bounded", options={"xatol": 0.2})
    negative(low)
    return max(found.values(), key=lambda item: item.value)


def _at_ratio(frame: Frame, prior: Prior | None, scale: float, ratio: float) -> Likelihood:
    r, A, logs = frame.whitened(ratio, scale, frame.columns, frame.memory_columns)
    n = r.size
    size = A.shape[1]
    weights = np.linalg.norm(A, axis=0)
    weights[weights == 0.0] = 1.0
    if size == 0:
        variance = max(float(r @ r), 1.0e-12) / max(r.size, 1)
        value = -0.5 * (r.size * math.log(variance) + logs + r.size)
        return Likelihood(value, Noise(variance * scale, ratio), np.zeros(0), np.zeros((0, 0)), r.size)
    normal = (A / weights).T @ (A / weights)
    target = (A / weights).T @ r
    pull, offset = np.zeros((size, size)), np.zeros(size)
    if prior is not None:
        W = prior.root
        pull[:4, :4] = W.T @ W
        offset[:4] = W.T @ W @ (prior.mean - np.array(frame.model.parameters))
    # r is in units of sqrt(scale); the prior counts as it is, which is as weak as it should be.
    total = normal + pull / np.outer(weights, weights) + 1.0e-12 * np.eye(size)
    step = np.linalg.solve(total, target + offset / weights)
    rss = float(r @ r - 2.0 * step @ target + step @ normal @ step)
    rss = max(rss, 1.0e-12)
    variance = rss / max(n, 1)  # in units of scale
    value = -0.5 * (n * math.log(variance) + logs + n)
    covariance = variance * np.linalg.inv(total) / np.outer(weights, weights)
    return Likelihood(value, Noise(variance * scale, ratio), step / weights, covariance, n)


@dataclass(frozen=True)
class Fit:
    """A model fitted to a part of a record: its likelihood, and the reference it was linearised along."""

    model: Model
    likelihood: Likelihood
    frame: Frame
    omit: NDArray[np.bool_]

    @property
    def noise(self) -> Noise:
        """Its own best noises."""
        return self.likelihood.noise

    @property
    def reference(self) -> Reference:
        """What it was linearised along."""
        return self.frame.reference

    @property
    def std(self) -> Float64Array:
        """Standard deviations of the model's vector."""
        return np.sqrt(np.maximum(np.diag(self.likelihood.covariance), 0.0))


def smoothed_reference(frame: Frame, correction: Float64Array, noise: Noise) -> Reference:
    """The reference smoothed under the corrected model."""
    n = frame.chain.reading.size
    means, variances = np.zeros((n, 2)), np.zeros((n, 2))
    chain = frame.chain._replace(defect=frame.chain.defect + frame.columns @ correction)
    with_memory = frame.memory_columns.shape[0] > 0
    if with_memory:
        chain = chain._replace(memory_defect=chain.memory_defect + frame.memory_columns @ correction)
    smooth(chain, noise.ratio * noise.variance / frame.record.data.period_s, noise.variance, means, variances)
    spread = np.maximum(np.sqrt(np.maximum(variances[:, 0], 0.0)), _LEAST_SPREAD * math.sqrt(noise.variance))
    speed = frame.reference.speed + means[:, 0]
    if not with_memory:
        return Reference.of_speed(speed, spread)
    coulomb = frame.model.parameters.coulomb
    memory_spread = np.clip(np.sqrt(np.maximum(variances[:, 1], 0.0)), 0.005 * coulomb, 0.3 * coulomb)
    return Reference(speed, spread, frame.reference.memory + means[:, 1], memory_spread)


def value_of(frame: Frame, noise: Noise) -> Likelihood:
    """Likelihood of the model as it stands, nothing corrected, at a given ratio of noises."""
    bare = replace(frame, columns=frame.columns[:, :0], memory_columns=frame.memory_columns[:, :0])
    return _at_ratio(bare, None, noise.variance, noise.ratio)


def _settle(
    record: Record, model: Model, reference: Reference, noise: Noise, omit: NDArray[np.bool_]
) -> tuple[Reference, Noise]:
    """A reference for a model with a memory, from one for a model without: smoothed a few times as the model stands."""
    for _ in range(_SETTLING_TURNS):
        frame = linearise(record, model, reference, noise, omit, with_columns=False)
        noise = likelihood(frame, None, noise).noise
        reference = smoothed_reference(frame, np.zeros(0), noise)
    return reference, noise


def fit_model(
    record: Record,
    model: Model,
    prior: Prior | None,
    reference: Reference,
    noise: Noise,
    omit: NDArray[np.bool_],
    *,
    turns: int = _FIT_TURNS,
) -> Fit:
    """Gauss-Newton on the model's vector, the reference smoothed anew in every turn, to the highest likelihood seen."""
    if model.effects.table().memory_state_at != ABSENT and np.isnan(reference.memory).any():
        reference, noise = _settle(record, model, reference, noise, omit)
    best: Fit | None = None
    damping = 1.0
    start = model
    step = np.zeros(0)
    for turn in range(turns):
        frame = linearise(record, model, reference, noise, omit)
        found = likelihood(frame, prior, noise)
        here = value_of(frame, found.noise)
        if best is not None and here.value < best.likelihood.value - _NOT_WORSE:
            damping *= 0.3
            if damping < _LEAST_DAMPING:
                break
        else:
            here = replace(here, covariance=found.covariance, correction=found.correction)
            best = Fit(model, here, frame, omit)
            start, step, noise = model, found.correction, found.noise
            std = np.sqrt(np.maximum(np.diag(found.covariance), 1.0e-300))
            if turn > 0 and bool(np.all(np.abs(step) < _SMALL_STEP * std)):
                break
            reference = smoothed_reference(frame, step, noise)
            damping = min(1.0, 2.0 * damping)
        model = start.with_vector(start.vector + damping * start.limited(step))
    assert best is not None
    return best
