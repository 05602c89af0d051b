"""A model linearised along the trajectory: one-step predictions, and their slopes by everything that is fitted."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.likelihood.levels import CurrentLevels, Integrated
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import Prediction, Record, Trajectory, predict
from rw_ekf.likelihood.unknown_past import variance_of_past
from rw_ekf.likelihood.whitening import Chain, innovations_of, whiten
from rw_ekf.likelihood.work_budget import whitening_units
from rw_ekf.model.state import SPEED

_ANY_PHASE = math.pi / math.sqrt(3.0)  # standard deviation of a phase of which nothing is known
_STUCK_SHARE = 0.1  # of the speed noise: what a wheel believed at rest may still be off by


@dataclass(eq=False, frozen=True)
class Linearisation:
    """Predictions of a model along a trajectory, and their slopes by everything that is fitted; arrays (n, ...)."""

    record: Record
    model: Model
    trajectory: Trajectory
    chain: Chain
    jacobian: Float64Array  # (n, p)
    memory_jacobian: Float64Array  # (n, p), or (0, p) for a model without a memory

    @property
    def follows_angle(self) -> bool:
        """Whether the chain's second quantity is the angle."""
        return follows_angle(self.record, self.model)

    @cached_property
    def innovation_at(self) -> NDArray[np.intp]:
        """Samples that have an innovation, whatever the noises."""
        return innovations_of(self.chain)

    def whitened(
        self, ratio: float, scale: float, jacobian: Float64Array, memory_jacobian: Float64Array | None = None
    ) -> tuple[Float64Array, Float64Array, float]:
        """(r, A, sum of log S) at R = scale and q = ratio R / period, over the samples that have an innovation."""
        n, m = jacobian.shape
        r, A = np.full(n, np.nan), np.zeros((n, m))
        logs, _ = self._whiten(ratio, scale, jacobian, memory_jacobian, r, A, np.zeros((0, 0)))
        at = np.flatnonzero(np.isfinite(r))
        used: slice | NDArray[np.intp] = at
        if at.size and at[-1] - at[0] == at.size - 1:  # nothing is missing in between: no copy
            used = slice(int(at[0]), int(at[-1]) + 1)
        if self.record.levels is None or self.record.levels.count == 0:
            return r[used], A[used], logs
        levels = self._levels(ratio, scale)
        return levels.taken_out(r[used]), levels.taken_out(A[used]), logs + levels.logs

    def whitened_sums(
        self, ratio: float, scale: float, jacobian: Float64Array, memory_jacobian: Float64Array | None = None
    ) -> tuple[Float64Array, float, int]:
        """(A, r)'(A, r) (m + 1, m + 1), the sum of log S and how many r there are, of what `whitened` gives."""
        m = jacobian.shape[1]
        if self.record.levels is not None and self.record.levels.count:
            r, A, logs = self.whitened(ratio, scale, jacobian, memory_jacobian)
            both = np.column_stack((A, r))
            return both.T @ both, logs, r.size
        sums = np.zeros((m + 1, m + 1))
        logs, count = self._whiten(ratio, scale, jacobian, memory_jacobian, np.zeros(0), np.zeros((0, m)), sums)
        return sums + np.tril(sums, -1).T, logs, count

    def _levels(self, ratio: float, scale: float) -> Integrated:
        """What unknown errors of rounded readings may have done to whitened rows, worked out once for each noise."""
        if (ratio, scale) not in self._integrated:
            assert self.record.levels is not None
            with_memory = self.memory_jacobian.shape[0] > 0
            speed, memory = self.record.levels.regressors(self.chain, with_memory=with_memory)
            rows = np.zeros(speed.shape)
            r = np.full(speed.shape[0], np.nan)
            self._whiten(ratio, scale, speed, memory, r, rows, np.zeros((0, 0)))
            self._integrated[ratio, scale] = Integrated.of(rows[np.isfinite(r)])
        return self._integrated[ratio, scale]

    @cached_property
    def _integrated(self) -> dict[tuple[float, float], Integrated]:
        return {}

    def _whiten(
        self,
        ratio: float,
        scale: float,
        jacobian: Float64Array,
        memory_jacobian: Float64Array | None,
        r: Float64Array,
        A: Float64Array,
        sums: Float64Array,
    ) -> tuple[float, int]:
        n, m = jacobian.shape
        held = np.zeros((0, m)) if memory_jacobian is None else memory_jacobian
        self.record.work.charge(whitening_units(n, m))
        rows = np.ascontiguousarray(jacobian)  # another layout would be compiled anew, in two seconds
        density = ratio * scale / self.record.period_s
        done: tuple[float, int] = whiten(self.chain, rows, np.ascontiguousarray(held), density, scale, r, A, sums)
        return done


@dataclass(frozen=True)
class Noise:
    """The two noises as a fit profiles them: R [rad^2/s^2] of a reading, and q dt / R (a filter: FilterConstants)."""

    variance: float
    ratio: float


def linearise(
    record: Record,
    model: Model,
    trajectory: Trajectory,
    noise: Noise,
    omit: BoolArray,
    *,
    with_jacobian: bool = True,
) -> Linearisation:
    """Predict every interval and differentiate by the model's vector; `omit` (n,) readings are left out.

    Where a ripple's angle is integrated, what it is wrong by is the chain's second quantity (`_with_angle`).
    """
    record = record.along(trajectory)
    followed = follows_angle(record, model)
    seen = model if with_jacobian else model.with_laws_as_curves
    centre = predict(
        record, seen.coefficients, seen.effects, seen.stribeck, trajectory, with_rows=with_jacobian or followed
    )
    with_memory = model.has_memory
    n = trajectory.speed.size
    if with_jacobian:
        jacobian, memory_jacobian = _jacobian(record, model, trajectory, centre.rows, with_memory=with_memory)
    else:
        jacobian, memory_jacobian = np.zeros((n, 0)), np.zeros((n if with_memory else 0, 0))
    extra = centre.bend**2 + np.where(record.follows, variance_of_past(record.course, model), 0.0)
    resting = record.follows & (centre.end == 0.0)
    extra[resting] += _STUCK_SHARE**2 * noise.variance
    if with_memory and np.isnan(trajectory.memory).any():  # the first time: the memory carried along is its trajectory
        trajectory = trajectory._replace(memory=_before(centre.memory_end, record, trajectory, model))
    step = np.where(record.follows, np.diff(record.course.time_s, prepend=record.course.time_s[:1]), 0.0)
    noisy = np.where(resting, 0.0, step)  # a torque that does not break the wheel away does not move it
    if isinstance(record.levels, CurrentLevels):
        extra += record.levels.variance(noisy)
    reading = np.where(omit, np.nan, record.course.speed_rad_s - trajectory.speed)
    chain = Chain(
        follows=record.follows,
        step_s=step,
        noisy_s=noisy,
        slopes=centre.slopes,
        defect=np.where(record.follows, centre.end - trajectory.speed, 0.0),
        memory_defect=np.where(record.follows, centre.memory_end - trajectory.memory, 0.0)
        if with_memory
        else np.zeros(extra.size),
        extra=extra,
        memory_variance=(0.5 * model.parameters.coulomb) ** 2 if with_memory else 0.0,
        reading=reading,
    )
    if followed:
        chain, per_speed = _with_angle(record, seen, trajectory, chain, centre)
        memory_jacobian = per_speed[:, None] * jacobian
    return Linearisation(record, model, trajectory, chain, jacobian, memory_jacobian)


def follows_angle(record: Record, model: Model) -> bool:
    """Whether readings say something of the angle: it is integrated, and a torque depends on it.

    Not beside a friction with a memory, which is the chain's second quantity then.
    """
    if not record.angle_is_integrated or model.has_memory:
        return False
    return any(term.effect.angular for term in model.terms)


def _with_angle(
    record: Record, model: Model, trajectory: Trajectory, chain: Chain, centre: Prediction
) -> tuple[Chain, Float64Array]:
    """The chain with the angle's error as its second quantity, and what an error of the speed adds to it [s], (n,).

    The angle turns by the mean of the speeds before and after, dtheta' = dtheta + dt/2 (domega + domega'); a sine and a
    cosine S, C of order n push by n (S C' - C S') per radian, with S', C' the slopes by them. Where a record has gaps
    the angle behind one is anybody's guess; where a part of a record begins it is known from the whole.
    """
    half_s = 0.5 * chain.step_s
    push, highest = np.zeros(half_s.size), 1.0
    for term, at in model.placed:
        if term.effect.angular:
            sine, cosine = (centre.rows[:, SPEED + 1 + place] for place in range(at.start, at.stop))
            order = term.shape[0]
            push += order * (term.values[0] * cosine - term.values[1] * sine)
            highest = max(highest, order)
    a = chain.slopes[:, 0]
    slopes = np.column_stack((a, push, half_s * (1.0 + a), 1.0 + half_s * push))
    angle = record.course.angle_rad
    turned = half_s * (np.roll(trajectory.speed, 1) + centre.end)
    defect = np.where(record.follows, np.roll(angle, 1) + turned - angle, 0.0)
    lost = _ANY_PHASE / highest if record.has_gaps else 0.0
    chain = chain._replace(slopes=np.ascontiguousarray(slopes), memory_defect=defect, memory_variance=lost**2)
    return chain, half_s


def _before(memory_end: Float64Array, record: Record, trajectory: Trajectory, model: Model) -> Float64Array:
    """Memory at each sample as a pass carried it along: its end where an interval led there, else settled or none."""
    settled = np.where(
        np.abs(trajectory.speed) > model.stribeck.omega_s, np.copysign(model.parameters.coulomb, trajectory.speed), 0.0
    )
    return np.where(record.follows, memory_end, settled)


def _jacobian(
    record: Record, model: Model, trajectory: Trajectory, rows: Float64Array, *, with_memory: bool
) -> tuple[Float64Array, Float64Array]:
    """Slopes of speeds and memories by the model's vector, (n, p) twice: written out where the flow knows them.

    The others - shapes, and coefficients of a delay, a current's lag or a Stribeck shape - are differences of passes.
    """
    p, known = model.vector.size, model.known
    n, states = rows.shape[0], model.effects.table().size
    jacobian = np.zeros((n, p))
    memory_jacobian = np.zeros((n if with_memory else 0, p))
    jacobian[:, :known] = rows[:, SPEED + 1 : SPEED + 1 + known]
    if with_memory:
        memory_jacobian[:, :known] = rows[:, states + SPEED + 1 : states + SPEED + 1 + known]
    others = [i for term, at in model.placed if not term.effect.analytic for i in range(at.start, at.stop)]
    _differences(record, model, trajectory, [*others, *range(known, p)], jacobian, memory_jacobian)
    return jacobian, memory_jacobian


def _differences(
    record: Record,
    model: Model,
    trajectory: Trajectory,
    places: list[int],
    jacobian: Float64Array,
    memory_jacobian: Float64Array,
) -> None:
    """Fill the jacobian at `places` of the model's vector by central differences of whole passes."""
    vector = model.vector
    sizes = _step_sizes(model) if places else []
    for j in places:
        h = sizes[j]
        ends, moved = [], []
        for sign in (1.0, -1.0):
            point = vector.copy()
            point[j] += sign * h
            there = model.with_vector(point)
            moved.append(there.vector[j])
            ends.append(
                predict(record, there.coefficients, there.effects, model.stribeck, trajectory, with_slopes=False)
            )
        width = moved[0] - moved[1]
        if width != 0.0:
            jacobian[:, j] = np.where(record.follows, (ends[0].end - ends[1].end) / width, 0.0)
            if memory_jacobian.shape[0]:
                change = (ends[0].memory_end - ends[1].memory_end) / width
                memory_jacobian[:, j] = np.where(record.follows, change, 0.0)


def _step_sizes(model: Model) -> list[float]:
    k, b, c, s = model.parameters
    sizes = [1.0e-3 * abs(k), max(1.0e-3 * abs(b), 1.0e-6), 1.0e-3 * c, 1.0e-3 * max(s, c)]
    sizes += [t.effect.coefficient.step_at(value) or 1.0e-3 * c for t in model.terms for value in t.values]
    return sizes + [model.terms[i].effect.constants[j].step_at(model.terms[i].shape[j]) for i, j in model.refined]
