"""The filter itself, its parameters frozen, over a record: states to judge by, and trajectories to linearise along."""

from __future__ import annotations

import math

import numpy as np

from rw_ekf.arrays import BoolArray
from rw_ekf.course.course import Course
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.filter.parameters_held import frozen, without_drift
from rw_ekf.likelihood.linearisation import Noise
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import Record, Trajectory, state_vector
from rw_ekf.model.state import COULOMB, SPEED, STATIC
from rw_ekf.wheel.effect_table import ABSENT

_OPEN_GATE = 1.0e30
_STUCK_SHARE = 0.01  # of R: what a wheel believed at rest may still be off by
_TRUSTING_RATIO = 1.0e-6  # q dt / R of a run that follows its model wherever readings allow
_SPREAD, _MEMORY_SPREAD = 0.3, 0.1  # of the speed noise and of Coulomb friction: what a filtered state is good to


def run_frozen(
    course: Course, model: Model, noise: Noise, constants: FilterConstants, *, keep_history: bool = False,
    walk: tuple[float, float] | None = None,
) -> FilterRun:  # fmt: skip
    """Filter `course` with a model that stays as it is; states are kept, and all that a smoother needs on demand.

    walk: of its dry friction, which alone is then followed: by how much [rad/s^2 per sqrt(s)], and how far from the
    model's it may be where the course begins [rad/s^2].
    """
    mean, covariance = frozen(model.parameters, state_vector(model.coefficients, model.effects))
    rate, off = walk or (0.0, 0.0)
    covariance[COULOMB, COULOMB] = covariance[STATIC, STATIC] = off**2
    covariance[COULOMB, STATIC] = covariance[STATIC, COULOMB] = off**2
    steered = without_drift(constants)._replace(
        dry_walk=rate**2,
        stribeck=model.stribeck,
        gate=_OPEN_GATE,
        speed_variance=max(noise.variance - model.effects.reading_variance, 1.0e-3 * noise.variance),
        acceleration_density=noise.ratio * noise.variance / course.period_s,
        stuck_variance=_STUCK_SHARE * noise.variance,
    )
    return filter_log(course, steered, mean, covariance, model.effects, keep_states=True, keep_history=keep_history)


def filtered_trajectory(record: Record, model: Model, noise: Noise, omit: BoolArray) -> Trajectory:
    """Speed and friction of a model with a memory as its own filter follows them through the part that is looked at.

    A trajectory smoothed under a model without the memory takes the wheel to rest where it was not, and a fit that
    starts from it may never leave there.
    """
    part = record.follows | np.append(record.follows[1:], False)
    model = model.with_laws_as_curves
    run = run_frozen(record.course.only(part & ~omit), model, Noise(noise.variance, _TRUSTING_RATIO), record.constants)
    at = model.effects.table().memory_state_at
    assert at != ABSENT
    n = record.course.samples
    return Trajectory(
        run.states[:, SPEED].copy(),
        np.full(n, _SPREAD * math.sqrt(noise.variance)),
        run.states[:, at].copy(),
        np.full(n, _MEMORY_SPREAD * model.parameters.coulomb),
    )
