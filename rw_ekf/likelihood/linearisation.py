"""A model linearised along the trajectory: one-step predictions, and their slopes by everything that is fitted."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.likelihood.model import Model
from rw_ekf.likelihood.one_step import Record, Trajectory, predict
from rw_ekf.likelihood.whitening import Chain, whiten
from rw_ekf.likelihood.work import whitening_units
from rw_ekf.model.state import SPEED
from rw_ekf.wheel.table import ABSENT

_STUCK_SHARE = 0.1  # of the speed noise: what a wheel believed at rest may still be off by


@dataclass(frozen=True)
class Linearisation:
    """Predictions of a model along a trajectory, and their slopes by everything that is fitted; arrays (n, ...)."""

    record: Record
    model: Model
    trajectory: Trajectory
    chain: Chain
    jacobian: Float64Array  # (n, p)
    memory_jacobian: Float64Array  # (n, p), or (0, p) for a model without a memory

    @cached_property
    def innovation_at(self) -> NDArray[np.intp]:
        """Samples that have an innovation, whatever the noises: those read, but the first of each stretch."""
        n = self.chain.reading.size
        r, none = np.full(n, np.nan), np.zeros((n, 0))
        whiten(self.chain, none, none[:0], 0.0, 1.0, r, none)
        return np.flatnonzero(np.isfinite(r))

    def whitened(
        self, ratio: float, scale: float, jacobian: Float64Array, memory_jacobian: Float64Array | None = None
    ) -> tuple[Float64Array, Float64Array, float]:
        """(r, A, sum of log S) at R = scale and q = ratio R / period, over the samples that have an innovation."""
        n, m = jacobian.shape
        r, A = np.full(n, np.nan), np.zeros((n, m))
        period = self.record.period_s
        held = np.zeros((0, m)) if memory_jacobian is None else memory_jacobian
        self.record.work.charge(whitening_units(n, m))
        rows = np.ascontiguousarray(jacobian)  # another layout would be compiled anew, in two seconds
        logs = whiten(self.chain, rows, np.ascontiguousarray(held), ratio * scale / period, scale, r, A)
        at = np.flatnonzero(np.isfinite(r))
        used: slice | NDArray[np.intp] = at
        if at.size and at[-1] - at[0] == at.size - 1:  # nothing is missing in between: no copy
            used = slice(int(at[0]), int(at[-1]) + 1)
        return r[used], A[used], logs


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
    """Predict every interval and differentiate by the model's vector; `omit` (n,) readings are left out."""
    centre = predict(record, model.coefficients, model.effects, model.stribeck, trajectory, with_rows=with_jacobian)
    with_memory = model.effects.table().memory_state_at != ABSENT
    n = trajectory.speed.size
    if with_jacobian:
        jacobian, memory_jacobian = _jacobian(record, model, trajectory, centre.rows, with_memory=with_memory)
    else:
        jacobian, memory_jacobian = np.zeros((n, 0)), np.zeros((n if with_memory else 0, 0))
    extra = centre.bend**2
    resting = record.follows & (centre.end == 0.0)
    extra[resting] += _STUCK_SHARE**2 * noise.variance
    if with_memory and np.isnan(trajectory.memory).any():  # the first time: the memory carried along is its trajectory
        trajectory = trajectory._replace(memory=_before(centre.memory_end, record, trajectory, model))
    step = np.where(record.follows, np.diff(record.course.time_s, prepend=record.course.time_s[:1]), 0.0)
    reading = np.where(omit, np.nan, record.course.speed_rad_s - trajectory.speed)
    chain = Chain(
        follows=record.follows,
        step_s=step,
        noisy_s=np.where(resting, 0.0, step),  # a torque that does not break the wheel away does not move it
        slopes=centre.slopes,
        defect=np.where(record.follows, centre.end - trajectory.speed, 0.0),
        memory_defect=np.where(record.follows, centre.memory_end - trajectory.memory, 0.0)
        if with_memory
        else np.zeros(extra.size),
        extra=extra,
        memory_variance=(0.5 * model.parameters.coulomb) ** 2 if with_memory else 0.0,
        reading=reading,
    )
    return Linearisation(record, model, trajectory, chain, jacobian, memory_jacobian)


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
