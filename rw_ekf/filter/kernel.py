"""The compiled pass over a log: the same transition and the same decisions as the online estimator, in one loop.

The equations are not here: transition, linear algebra and decisions are plain Python functions, compiled as they stand.
Where a model has no hidden state the linear algebra is filterpy's online; a golden test holds the two together
(tests/filter/test_golden.py).
"""

from __future__ import annotations

import math
import sys
from typing import Any, NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, by_identity
from rw_ekf.compiled import compile_cached, make_jitable
from rw_ekf.course import course as _course
from rw_ekf.course.course import Course
from rw_ekf.filter import constants as _constants
from rw_ekf.filter import covariance as _covariance
from rw_ekf.filter import decisions as _decisions
from rw_ekf.filter import filter_run as _filter_run
from rw_ekf.filter import health as _health
from rw_ekf.filter import stillness as _stillness
from rw_ekf.filter.constants import FilterConstants, filter_constants
from rw_ekf.filter.covariance import (
    cap_variance,
    drop_settled,
    predict_covariance,
    predict_covariance_full,
    seed_speed,
    set_ceiling,
    update_joseph,
)
from rw_ekf.filter.decisions import (
    BACKWARD,
    FIRST,
    MEMORY_SIZE,
    MISSING,
    REPEATED,
    RESEEDED,
    UPDATED,
    doubt,
    elapse,
    forget,
    gating,
    most_acceleration,
    timing,
    within_reach,
)
from rw_ekf.filter.filter_run import FilterRun, History
from rw_ekf.filter.health import (
    HEALTH_SIZE,
    WELL,
    Grounds,
    breakage,
    examine,
    is_diverged,
    keep,
    lay_grounds,
    learns,
    mend,
    notice,
    start_health,
)
from rw_ekf.filter.stillness import (
    STILLNESS_SIZE,
    away_from_reference,
    dead_band,
    follow,
    start_following,
    unlearn_shift,
)
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, SPEED, STATE_SIZE, STATIC, VISCOUS
from rw_ekf.wheel.effect_transition import effect_transition, open_past, seed_hidden
from rw_ekf.wheel.equations import EQUATIONS
from rw_ekf.wheel.interval import Interval
from rw_ekf.wheel.table import NO_EFFECTS, EffectTable
from rw_ekf.wheel.transition import transition

make_jitable(
    [
        timing, doubt, forget, elapse, most_acceleration, within_reach, gating,
        cap_variance, drop_settled, predict_covariance, predict_covariance_full, seed_speed, set_ceiling, update_joseph,
        away_from_reference, dead_band, follow, start_following, unlearn_shift,
        breakage, examine, is_diverged, keep, learns, mend, notice, start_health,
    ]
)  # fmt: skip
make_jitable([lay_grounds], allocating=True)

# Everything that is compiled into the pass: its cache is stale when one of them changes.
_MODULES = [
    *EQUATIONS,
    _course,
    _constants,
    _covariance,
    _decisions,
    _filter_run,
    _health,
    _stillness,
    sys.modules[__name__],
]


def _record(history: History, i: int, x: Float64Array, P: Float64Array, row: Float64Array, noise: Float64Array) -> None:
    """Keep what a smoother needs of step i: the prediction and the transition that led to it."""
    n = x.size
    for j in range(n):  # element by element: an assignment of slices takes numba four seconds longer to compile
        history.predicted[i, j] = x[j]
        history.row[i, j] = row[j]
        history.noise[i, j] = noise[j]
        for m in range(n):
            history.covariance[i, j, m] = P[j, m]


make_jitable([_record])


@by_identity
class Workplace(NamedTuple):
    """What the pass remembers from one sample to the next beside its belief, and scratch for its linear algebra."""

    noise: Float64Array  # (n,)
    row: Float64Array  # (n,)
    L: Float64Array  # (n + 2, n)
    work: Float64Array  # (n,)
    F: Float64Array  # (n, n) the identity but for the rows of what moves
    product: Float64Array  # (n, n)
    points: Float64Array  # (3 n + 6, n); with effects
    gate_memory: Float64Array
    stillness: Float64Array
    health: Float64Array
    ceiling: Float64Array  # (n,)
    grounds: Grounds


def _filter_pass(
    constants: FilterConstants, table: EffectTable | None, course: Course, run: FilterRun, mends: bool
) -> None:
    """Filter a whole log in place; see `filter_log`. Histories of zero rows are not written.

    mends: whether a broken filter is reset, as online. Without effects (a state of five) table is None, and neither
    temperature nor angle is read.
    Each test of `table` stands alone: numba then leaves out the branch, and with it two thirds of the compiler's time.
    """
    x, P = run.mean, run.covariance
    n = x.size
    ceiling = np.zeros(n)
    set_ceiling(ceiling, P, constants, np.zeros(0) if table is None else table.drift)
    workplace = Workplace(
        noise=np.zeros(n),
        row=np.zeros(n),
        L=np.zeros((n + 2, n)),
        work=np.zeros(n),
        F=np.eye(n),
        product=np.zeros((n, n)),
        points=np.zeros((0 if table is None else 3 * n + 6, n)),
        gate_memory=np.zeros(MEMORY_SIZE),
        stillness=np.zeros(STILLNESS_SIZE),
        health=np.zeros(HEALTH_SIZE),
        ceiling=ceiling,
        grounds=lay_grounds(x, P, ceiling),
    )
    _filter_each(constants, table, course, run, mends, workplace)


def _filter_each(
    constants: FilterConstants, table: EffectTable | None, course: Course, run: FilterRun, mends: bool,
    workplace: Workplace,
) -> None:  # fmt: skip
    """The pass itself; it allocates nothing (see `make_jitable`)."""
    time_s, speed_rad_s, segment = course.time_s, course.speed_rad_s, course.segment
    pieces, piece_start, first_piece = course.pieces, course.piece_start, course.first_piece
    current_A = pieces.current_A
    temperature_degC, angle_rad = course.temperature_degC, course.angle_rad
    x, P, innovation, innovation_variance, outcome, mended, states, stds, history = run
    noise, row, L, work, F, product, points, gate_memory, stillness, health, ceiling, grounds = workplace
    n_samples = time_s.size
    n = x.size
    R = constants.speed_variance
    keep_state = states.shape[0] > 0
    keep_all = history.predicted.shape[0] > 0
    temperature, angle = 20.0, 0.0  # until known: effects of temperature are relative to 20 degC
    before = 0.0
    seeded = ever_seeded = opens = False
    band = dead_band(P, R, constants.acceleration_density)
    start_following(stillness, band)
    start_health(health)
    learning = mends and learns(P)
    last = 0  # the sample the state belongs to
    for i in range(n_samples):
        speed = speed_rad_s[i]
        has_speed = not math.isnan(speed)
        innovation[i] = math.nan
        innovation_variance[i] = math.nan
        mended[i] = WELL
        dt = time_s[i] - time_s[last] if i > 0 else 1.0
        new_segment = segment[i] != segment[last]
        what = timing(dt, seeded, new_segment, has_speed, constants.max_gap_s)
        if what != REPEATED and what != BACKWARD:  # noqa: PLR1714 - numba
            continuous = seeded and not new_segment and dt <= constants.max_gap_s
            elapsed = dt if i > 0 and not new_segment else 0.0
            noise[MOTOR_GAIN] = constants.motor_gain_drift * elapsed
            noise[VISCOUS] = constants.viscous_drift * elapsed
            noise[COULOMB] = constants.coulomb_drift * elapsed
            noise[STATIC] = constants.static_drift * elapsed
            if table is not None:
                for j in range(table.drift.size):
                    noise[STATE_SIZE + j] = table.drift[j] * elapsed
            away = 0.0
            if continuous:
                before = x[SPEED]
                away = away_from_reference(stillness, before, band, constants.stribeck.omega_s)
                x[SPEED] -= away
            if continuous and table is not None:
                if opens:  # only now, after the estimate: online the first command follows it
                    open_past(x, P, table, current_A[first_piece[last]])
                    opens = False
                interval = Interval(
                    time_s[last], time_s[i], temperature, angle, first_piece[i], piece_start[last], piece_start[i]
                )
                curvature = effect_transition(x, P, table, constants.stribeck, pieces, interval, F, points)
                for j in range(n):
                    row[j] = F[SPEED, j]
                if away != 0.0:
                    for j in range(n):
                        x[j] += F[j, SPEED] * away
                angle += 0.5 * (before + x[SPEED]) * dt
                noise[SPEED] = constants.acceleration_density * dt + curvature
                if x[SPEED] == 0.0:
                    noise[SPEED] += constants.stuck_variance
            elif continuous:
                x[SPEED], curvature = transition(
                    x, P, constants.stribeck, pieces, piece_start[last], piece_start[i], row, L
                )
                if away != 0.0:
                    x[SPEED] += row[SPEED] * away
                noise[SPEED] = constants.acceleration_density * dt + curvature
                if x[SPEED] == 0.0:
                    noise[SPEED] += constants.stuck_variance
            if continuous:
                elapse(gate_memory, dt, current_A, piece_start[last], piece_start[i])
            else:  # the speed starts afresh, or waits for a reading that it can start from
                row[:] = 0.0
                row[SPEED] = 0.0 if has_speed else 1.0
                noise[SPEED] = R if has_speed else 0.0
                seeded = False
            hidden = 0
            if table is not None:
                hidden = table.hidden
            if continuous and hidden > 0:
                predict_covariance_full(P, F, noise, product)
                drop_settled(P, hidden)
            else:
                predict_covariance(P, row, noise, work)
            if not continuous and has_speed:
                what = RESEEDED if ever_seeded else FIRST
                seed_speed(x, P, speed, R)
                if table is not None:
                    held = max(piece_start[i] - 1, first_piece[i])  # in force when the speed was read
                    if hidden > 0:
                        held = min(held, current_A.size - 1)
                        seed_hidden(x, P, table, current_A[held], constants.stribeck.omega_s)
                    opens = piece_start[i] <= first_piece[i] < current_A.size
                seeded = ever_seeded = True
                forget(gate_memory)
                follow(stillness, speed, band, 0.0)
            if keep_all:
                _record(history, i, x, P, row, noise)
            if what == UPDATED:
                residual = speed - x[SPEED]
                S = P[SPEED, SPEED] + R
                innovation[i] = residual
                innovation_variance[i] = S
                what = gating(residual, S, speed, x, P, R, constants.gate, constants.reseed_after, gate_memory)
                if what == UPDATED:
                    update_joseph(x, P, residual, S, R, work)
                elif what == RESEEDED:
                    seed_speed(x, P, speed, R)
                    if table is not None:
                        held = max(piece_start[i] - 1, first_piece[i])
                        if hidden > 0:
                            seed_hidden(x, P, table, current_A[held], constants.stribeck.omega_s)
                    doubt(gate_memory)
                    follow(stillness, speed, band, 0.0)
                    if keep_all:
                        row[:] = 0.0
                        _record(history, i, x, P, row, noise)
            verdict = WELL
            residual, S = 0.0, 1.0
            if not math.isnan(innovation[i]):
                residual, S = innovation[i], innovation_variance[i]
            if learning and notice(health, x, P, what, residual, S, constants.gate, elapsed):
                cap_variance(P, ceiling)
                verdict = examine(health, x, P, grounds, what)
            if verdict != WELL:
                mended[i] = verdict
                mend(health, verdict, x, P, grounds)
                seed_speed(x, P, speed if has_speed else 0.0, R)
                if has_speed:
                    follow(stillness, speed, band, 0.0)
                seeded = has_speed
                ever_seeded = ever_seeded or has_speed
                what = RESEEDED if has_speed else MISSING
                if table is not None:
                    held = max(piece_start[i] - 1, first_piece[i])
                    if hidden > 0:
                        held = min(held, current_A.size - 1)
                        seed_hidden(x, P, table, current_A[held], constants.stribeck.omega_s)
                forget(gate_memory)
                if keep_all:
                    row[:] = 0.0
                    _record(history, i, x, P, row, noise)
            elif continuous:
                shift = follow(stillness, x[SPEED], band, dt)
                if shift != 0.0:
                    unlearn_shift(P, shift)
            last = i
            if table is not None:
                if not math.isnan(temperature_degC[i]):
                    temperature = temperature_degC[i]
                if not math.isnan(angle_rad[i]):
                    angle = angle_rad[i]
        elif keep_all:  # skipped: for a smoother the state just stays
            row[:] = 0.0
            row[SPEED] = 1.0
            noise[:] = 0.0
            _record(history, i, x, P, row, noise)
        outcome[i] = what
        if keep_state:
            for j in range(n):
                states[i, j] = x[j]
                stds[i, j] = math.sqrt(P[j, j])


make_jitable([_filter_each])


def _example(*, with_effects: bool) -> tuple[Any, ...]:
    """Arguments of the types that `filter_log` gives."""
    series = np.zeros(0)
    return (
        filter_constants(1.0),
        NO_EFFECTS.table() if with_effects else None,
        Course.of(series, series, series),
        FilterRun.empty(np.zeros(STATE_SIZE), np.eye(STATE_SIZE), 0),
        False,
    )


filter_pass = compile_cached(_filter_pass, _MODULES, lambda: _example(with_effects=False))
# A kernel of its own, because without effects a third of it has to be compiled.
filter_pass_with_effects = compile_cached(
    _filter_pass, _MODULES, lambda: _example(with_effects=True), name="_filter_pass_with_effects"
)
