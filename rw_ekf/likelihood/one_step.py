"""One-step predictions along a trajectory: what a model says of every interval, and how it depends on things.

The trajectory is the smoothed speed, close to the truth whatever the model lacks: each interval is predicted from it on
its own, so that a wrong model shows as a defect where it is wrong and nowhere else (docs/likelihood.md eq. 1-2).
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array, by_identity
from rw_ekf.compiled import Kernel
from rw_ekf.course import course as _course
from rw_ekf.course.course import Course
from rw_ekf.course.grid import grid_of
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.likelihood.levels import CurrentLevels, Levels
from rw_ekf.likelihood.torque_noise import TorqueNoisePrior
from rw_ekf.likelihood.work_budget import Work, pass_units, unlimited
from rw_ekf.model.friction import FAST_STRIBECK_SPEEDS, FrictionCurve, Stribeck
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, SPEED, STATE_SIZE, STATIC, VISCOUS
from rw_ekf.wheel.effect_table import ABSENT, NO_EFFECTS, EffectSet, EffectTable
from rw_ekf.wheel.equations import EQUATIONS
from rw_ekf.wheel.interval import Interval, Pieces, interval_after
from rw_ekf.wheel.pieces import effect_interval, row_size
from rw_ekf.wheel.transition import interval

LEAST_SPREAD = 0.02  # of the speed noise: no trajectory is known better
_SPREAD = math.sqrt(3.0)
_COURSE_ANGLE = np.zeros(0)
_ROUNDED = 0.5 / 12.0  # of the square of a grid, half of what an even error within a cell has


@by_identity
class Trajectory(NamedTuple):
    """The trajectory that everything is linearised along: smoothed speed and, with a memory, friction; arrays (n,)."""

    speed: Float64Array
    spread: Float64Array  # standard deviation [rad/s]
    memory: Float64Array  # friction with a memory [rad/s^2]; NaN where it is not known yet
    memory_spread: Float64Array
    angle: Float64Array = _COURSE_ANGLE  # [rad], where it is followed too; else (0,), and the course's counts

    @classmethod
    def of_speed(cls, speed: Float64Array, spread: Float64Array) -> Trajectory:
        """Of a speed alone."""
        return cls(speed, spread, np.full(speed.size, np.nan), np.full(speed.size, np.nan))

    def along(self, free_run_rad_s: Float64Array, noise_rad_s: float) -> Trajectory:
        """A free run (m,) of a record's head, NaN where there is none, and this one after it and in its gaps.

        Readings as noisy as a wheel is fast near rest do not show when it breaks away. A free run does, from all that
        the wheel does elsewhere; a trajectory that was smoothed without it may rest where the wheel does not.
        """
        speed, spread = self.speed.copy(), self.spread.copy()
        ran = np.flatnonzero(np.isfinite(free_run_rad_s))
        speed[ran], spread[ran] = free_run_rad_s[ran], LEAST_SPREAD * noise_rad_s
        return Trajectory.of_speed(speed, spread)


@by_identity
class Prediction(NamedTuple):
    """One-step predictions of every interval, (n,) at the sample it leads to; 0 where none does."""

    end: Float64Array  # [rad/s]
    memory_end: Float64Array  # [rad/s^2]
    slopes: Float64Array  # (n, 4) of (speed, memory) by (speed, memory), row by row, or (0, 4)
    bend: Float64Array  # curvature neglected near zero speed [rad/s]
    rows: Float64Array  # (n, m) slopes by the state, (n, 2 m) with those of a memory behind, or (0, m)


@by_identity
class _Scratch(NamedTuple):
    """What a pass writes on; states (n,)."""

    state: Float64Array  # where an interval begins
    end: Float64Array  # where it ends
    point: Float64Array  # beside the state, for a difference
    up: Float64Array  # where the interval ends from there
    down: Float64Array
    row: Float64Array  # (`row_size`,)

    @classmethod
    def of(cls, x: Float64Array) -> _Scratch:
        """Beginning with the state x (n,)."""
        n = x.size
        return cls(x.copy(), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(row_size(n)))


def _propagate(
    state: Any, table: EffectTable | None, stribeck: Stribeck, pieces: Pieces, between: Interval, slopes: bool,
    row: Any, end: Any,
) -> None:  # fmt: skip
    """`effect_interval`, or what is left of it without effects."""
    if table is None:
        curve = FrictionCurve(state[VISCOUS], state[COULOMB], state[STATIC], stribeck.omega_s, stribeck.law)
        end[SPEED], row[SPEED], row[MOTOR_GAIN], row[VISCOUS], row[COULOMB], row[STATIC] = interval(
            state[SPEED], state[MOTOR_GAIN], curve, pieces, between.start, between.stop, slopes
        )
    if table is not None:
        effect_interval(state, table, stribeck, pieces, between, slopes, row, end)


def _begin_hidden(state: Any, at: int, lag_at: int, course: Course, i: int, rests: bool, coulomb: float) -> None:
    """Where nothing leads to sample i: a memory that is settled, at the begin of a log a current that is.

    at, lag_at: of the memory and the lagging current in the state, or `ABSENT`.
    """
    if lag_at >= 0 and (i == 0 or course.segment[i] != course.segment[i - 1]):
        state[lag_at] = course.pieces.current_A[max(course.piece_start[i] - 1, course.first_piece[i])]
    if at >= 0:
        state[at] = 0.0 if rests else math.copysign(coulomb, state[SPEED])


def _differ(
    scratch: _Scratch, table: EffectTable | None, stribeck: Stribeck, pieces: Pieces, between: Interval, moved: int,
    h: float,
) -> None:  # fmt: skip
    """Where the interval leads, in `up` and `down`, with one number of the state greater and less by h."""
    state, _, point, up, down, row = scratch
    for j in range(state.size):
        point[j] = state[j]
    point[moved] = state[moved] + h
    _propagate(point, table, stribeck, pieces, between, False, row, up)
    point[moved] = state[moved] - h
    _propagate(point, table, stribeck, pieces, between, False, row, down)


def _one_step_pass(
    x: Any, table: EffectTable | None, stribeck: Stribeck, course: Course, follows: Any, trajectory: Trajectory,
    out: Prediction, scratch: _Scratch,
) -> None:  # fmt: skip
    """Predict sample i + 1 from the trajectory at i wherever follows[i + 1]; fill `out`, which holds zeros.

    A memory is carried on from the interval before where its trajectory is NaN. Slopes are statistical near zero, over
    the spreads of the trajectory; `out` has no rows of slopes, or of rows, where they are not wanted. Without effects
    table is None. The state of `scratch` holds x.
    """
    pieces = course.pieces
    speed, spread, memory, memory_spread, _ = trajectory
    state, ended, _, up, down, row = scratch
    n = x.size
    analytic = out.rows.shape[0] > 0
    sloped = out.slopes.shape[0] > 0
    omega_s = stribeck.omega_s
    near_zero_speed = FAST_STRIBECK_SPEEDS * omega_s
    at, lag_at, hidden, has_slope = ABSENT, ABSENT, 0, True
    if table is not None:
        at, lag_at, hidden = table.memory_state_at, table.lag_state_at, table.hidden
        has_slope = at < 0  # by the speed where the interval begins: neither a late current nor a window depends on it
        if table.stribeck_at >= 0:
            near_zero_speed = max(near_zero_speed, FAST_STRIBECK_SPEEDS * x[table.stribeck_at])
    for i in range(course.time_s.size - 1):
        if not follows[i + 1] and (lag_at < 0 or course.segment[i] != course.segment[i + 1]):
            continue
        state[SPEED] = speed[i]
        if not follows[i]:
            _begin_hidden(state, at, lag_at, course, i, not abs(speed[i]) > omega_s, x[COULOMB])
        if at >= 0 and not math.isnan(memory[i]):
            state[at] = memory[i]
        between = interval_after(course, i)
        if not follows[i + 1]:  # not looked at, but the lagging current continues
            _propagate(state, table, stribeck, pieces, between, False, row, ended)
            state[lag_at] = ended[lag_at]
            continue
        near = abs(speed[i]) < near_zero_speed or speed[i] * speed[i + 1] <= 0.0
        differs = sloped and (near or not has_slope)
        written = analytic or (sloped and not differs)
        _propagate(state, table, stribeck, pieces, between, written, row, ended)
        out.end[i + 1] = ended[SPEED]
        if written and sloped:
            out.slopes[i + 1, 0] = row[SPEED]
        for j in range(out.rows.shape[1] if analytic else 0):
            out.rows[i + 1, j] = row[j]
        if differs:
            h = _SPREAD * spread[i]
            _differ(scratch, table, stribeck, pieces, between, SPEED, h)
            out.slopes[i + 1, 0] = (up[SPEED] - down[SPEED]) / (2.0 * h)
            if near:
                out.bend[i + 1] = (up[SPEED] + down[SPEED] - 2.0 * ended[SPEED]) / math.sqrt(12.0)
        if differs and at >= 0:
            out.slopes[i + 1, 2] = (up[at] - down[at]) / (2.0 * h)
            h = _SPREAD * memory_spread[i]
            _differ(scratch, table, stribeck, pieces, between, at, h)
            out.slopes[i + 1, 1] = (up[SPEED] - down[SPEED]) / (2.0 * h)
            out.slopes[i + 1, 3] = (up[at] - down[at]) / (2.0 * h)
        for j in range(n - hidden, n):
            state[j] = ended[j]
        if at >= 0:
            out.memory_end[i + 1] = ended[at]


def _example(*, with_effects: bool) -> tuple[Any, ...]:
    series, whole = np.zeros(0), np.zeros((0, STATE_SIZE))
    course = Course.of(series, series, series)
    return (
        np.zeros(STATE_SIZE), NO_EFFECTS.table() if with_effects else None, Stribeck(1.0, 0), course,
        np.zeros(0, np.bool_), Trajectory(*[series] * 4), Prediction(series, series, whole, series, whole),
        _Scratch.of(np.zeros(STATE_SIZE)),
    )  # fmt: skip


_MODULES = [*EQUATIONS, _course, sys.modules[__name__]]
one_step_pass = Kernel(_one_step_pass, _MODULES, lambda: _example(with_effects=False), sizes_known=True)
one_step_pass_with_effects = Kernel(_one_step_pass, _MODULES, lambda: _example(with_effects=True), "with_effects")


@dataclass(eq=False, frozen=True)
class Record:
    """A course with its conditions filled in, the intervals that are looked at, and the budget for looking."""

    course: Course
    follows: BoolArray  # (n,) sample i is reached from i - 1 by one interval, within the part that is looked at
    constants: FilterConstants  # of the filter that runs over it
    log_of: Int64Array  # (n,) which of the logs in one diagnosis a sample belongs to, rising from 0
    work: Work = field(default_factory=unlimited)  # what the diagnosis has cost so far: one count for all its records
    torque_noise: TorqueNoisePrior | None = None  # None: any amount is as likely as none
    angle_is_integrated: bool = False  # the course's angle: from speeds, so that it is lost slowly; else logged
    least_variance: float = 0.0  # [rad^2/s^2] of the readings: half of what rounding leaves of them
    levels: Levels | CurrentLevels | None = None  # where readings that are rounded, or currents, share an unknown error

    @classmethod
    def of(
        cls,
        course: Course,
        part: BoolArray,
        constants: FilterConstants,
        work: Work | None = None,
        log_of: Int64Array | None = None,
        torque_noise: TorqueNoisePrior | None = None,
        *,
        angle_is_integrated: bool = False,
    ) -> Record:
        """Mark what belongs to `part` (n,); log_of (n,): see there; all one log by default."""
        dt = np.diff(course.time_s, prepend=np.nan)
        same = np.diff(course.segment, prepend=-1) == 0
        follows = same & (dt > 0.0) & (dt <= constants.max_gap_s) & part & np.roll(part, 1)
        follows[:1] = False
        logs = np.zeros(dt.size, dtype=np.int64) if log_of is None else log_of
        counted = unlimited() if work is None else work
        least_variance = _ROUNDED * (grid_of(course.speed_rad_s) or 0.0) ** 2
        return cls(course, follows, constants, logs, counted, torque_noise, angle_is_integrated, least_variance)

    def within(self, part: BoolArray) -> Record:
        """The same of a part (n,) alone."""
        return replace(self, follows=self.follows & part & np.roll(part, 1))

    def along(self, trajectory: Trajectory) -> Record:
        """The same, its angle that of a trajectory that follows it."""
        if not trajectory.angle.size:
            return self
        return replace(self, course=self.course._replace(angle_rad=trajectory.angle))

    @cached_property
    def has_gaps(self) -> bool:
        """Whether some sample cannot be reached from the one before; blocks of a part are no gaps."""
        course = self.course
        step_s = np.diff(course.time_s)
        return bool(np.any((np.diff(course.segment) != 0) | (step_s > self.constants.max_gap_s) | (step_s <= 0.0)))

    @cached_property
    def period_s(self) -> float:
        """The course's, found once [s]."""
        return self.course.period_s


def state_vector(parameters: Float64Array, effects: EffectSet) -> Float64Array:
    """State (m,) with the speed and hidden states zero: four parameters, then coefficients."""
    table = effects.table()
    x = np.zeros(table.size)
    x[SPEED + 1 : SPEED + 1 + parameters.size] = parameters
    return x


def predict(
    record: Record,
    parameters: Float64Array,
    effects: EffectSet,
    stribeck: Stribeck,
    trajectory: Trajectory,
    *,
    with_rows: bool = False,
    with_slopes: bool = True,
) -> Prediction:
    """One-step predictions for parameters (4 + coefficients,) along a trajectory."""
    table = effects.table()
    n = trajectory.speed.size
    out = Prediction(
        np.zeros(n),
        np.zeros(n),
        np.zeros((n if with_slopes else 0, 4)),
        np.zeros(n),
        np.zeros((n if with_rows else 0, table.size * (1 if table.memory_at == ABSENT else 2))),
    )
    record.work.charge(pass_units(int(np.count_nonzero(record.follows)), table, slopes=with_slopes, rows=with_rows))
    x = state_vector(parameters, effects)
    memory_spread = np.where(np.isnan(trajectory.memory_spread), 0.1 * abs(x[COULOMB]), trajectory.memory_spread)
    speed, spread, memory = map(np.ascontiguousarray, trajectory[:3])
    along = Trajectory(speed, spread, memory, memory_spread)
    if table.size > STATE_SIZE:
        one_step_pass_with_effects(x, table, stribeck, record.course, record.follows, along, out, _Scratch.of(x))
    else:
        one_step_pass(x, None, stribeck, record.course, record.follows, along, out, _Scratch.of(x))
    return out
