"""The compiled pass over a log: the step of `step`, sample after sample, in one loop."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.compiled import Kernel
from rw_ekf.course import course as _course
from rw_ekf.course.course import Course
from rw_ekf.filter import constants as _constants
from rw_ekf.filter import covariance as _covariance
from rw_ekf.filter import filter_run as _filter_run
from rw_ekf.filter import gating as _gating
from rw_ekf.filter import health as _health
from rw_ekf.filter import step as _step
from rw_ekf.filter import stillness as _stillness
from rw_ekf.filter.constants import FilterConstants, filter_constants
from rw_ekf.filter.filter_run import FilterRun, History
from rw_ekf.filter.gating import BACKWARD, MISSING, REPEATED, RESEEDED, UPDATED, timing
from rw_ekf.filter.health import WELL
from rw_ekf.filter.step import (
    CONTINUOUS,
    Memory,
    Sample,
    advance,
    innovation_of,
    is_continuous,
    look_after,
    memory_of,
    weigh,
)
from rw_ekf.model import effect as _effect
from rw_ekf.model.effect import REFERENCE_DEGC
from rw_ekf.model.law import MOST_COLUMNS
from rw_ekf.model.state import SPEED, STATE_SIZE
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectTable
from rw_ekf.wheel.effect_transition import open_past
from rw_ekf.wheel.equations import EQUATIONS
from rw_ekf.wheel.interval import Interval, columns_at, last_known

# Places in `past`: what was last known of what effects are functions of, and whether the log opens at the last sample.
TEMPERATURE = 0  # [degC]; until known, that which effects of temperature are relative to
ANGLE = 1  # [rad]
COLUMNS = 2  # of a learned law, and the two places behind it
OPENS = 5
_PAST_SIZE = 6

# Everything that is compiled into the pass: its cache is stale when one of them changes.
_MODULES = [
    *EQUATIONS,
    _course,
    _constants,
    _covariance,
    _gating,
    _effect,
    _filter_run,
    _health,
    _step,
    _stillness,
    sys.modules[__name__],
]


def _record(history: History, i: int, x: Float64Array, P: Float64Array, memory: Memory) -> None:
    """Keep what a smoother needs of step i: the prediction and the transition that led to it."""
    n = x.size
    for j in range(n):
        history.predicted[i, j] = x[j]
        history.row[i, j] = memory.F[SPEED, j]
        history.noise[i, j] = memory.noise[j]
        for m in range(n):
            history.covariance[i, j, m] = P[j, m]


def _record_apart(history: History, i: int, x: Float64Array, P: Float64Array, memory: Memory, keeps: float) -> None:
    """The same where no transition led to the speed: it was seeded (keeps: 0), or the sample is left alone (1)."""
    for j in range(x.size):
        memory.F[SPEED, j] = 0.0
        memory.noise[j] *= 1.0 - keeps
    memory.F[SPEED, SPEED] = keeps
    _record(history, i, x, P, memory)


def _filter_pass(
    constants: FilterConstants,
    table: EffectTable | None,
    course: Course,
    run: FilterRun,
    memory: Memory,
    past: Float64Array,
    begin: int,
) -> None:
    """Filter samples of a log from `begin` on in place; see `filter_log`. Histories of zero rows are not written.

    Where begin is above zero the state is that of the sample before it. past: `nothing_past()`, or as that left it.
    Without effects (a state of five) table is None, and neither temperature nor angle is read.
    """
    time_s, speed_rad_s, segment = course.time_s, course.speed_rad_s, course.segment
    pieces, piece_start, first_piece = course.pieces, course.piece_start, course.first_piece
    current_A = pieces.current_A
    x, P, innovation, innovation_variance, outcome, mended, states, stds, history = run
    keep_state = states.shape[0] > 0
    keep_all = history.predicted.shape[0] > 0
    temperature, angle = past[TEMPERATURE], past[ANGLE]
    columns = (past[COLUMNS], past[COLUMNS + 1], past[COLUMNS + 2])
    opens = past[OPENS] == 1.0
    last = max(begin - 1, 0)  # the sample the state belongs to
    for i in range(begin, time_s.size):
        innovation[i] = math.nan
        innovation_variance[i] = math.nan
        mended[i] = WELL
        first = i == 0
        in_force = max(min(max(piece_start[i] - 1, first_piece[i]), current_A.size - 1), 0)
        sample = Sample(
            1.0 if first else time_s[i] - time_s[last],
            speed_rad_s[i],
            first or segment[i] != segment[last],
            current_A[in_force] if current_A.size > 0 else 0.0,
        )
        what = timing(sample.dt_s, sample.new_segment)
        if what in (REPEATED, BACKWARD):
            if keep_all:
                _record_apart(history, i, x, P, memory, 1.0)
        else:
            before = x[SPEED]
            if table is not None and opens and is_continuous(memory, constants, sample):
                open_past(x, P, table, current_A[first_piece[last]])  # only now: online the first command comes later
                opens = False
            interval = Interval(
                time_s[last], time_s[i], temperature, angle, first_piece[i], piece_start[last], piece_start[i], columns
            )
            what = advance(x, P, memory, constants, table, sample, pieces, interval)
            if table is not None:
                if memory.now[CONTINUOUS] == 1.0:
                    turned = 0.5 * (before + x[SPEED]) * sample.dt_s
                    angle += turned if math.isfinite(turned) else 0.0
                elif not math.isnan(sample.speed_rad_s):
                    opens = piece_start[i] <= first_piece[i] < current_A.size
            if keep_all:
                _record(history, i, x, P, memory)
            judged = (0.0, 1.0)
            if what == UPDATED:
                judged = innovation_of(x, P, constants, sample)
                innovation[i], innovation_variance[i] = judged
                what = weigh(x, P, memory, constants, table, sample)
                if keep_all and what == RESEEDED:
                    _record_apart(history, i, x, P, memory, 0.0)
            verdict = look_after(x, P, memory, constants, table, sample, what, judged)
            if verdict != WELL:
                mended[i] = verdict
                what = MISSING if math.isnan(sample.speed_rad_s) else RESEEDED
                if keep_all:
                    _record_apart(history, i, x, P, memory, 0.0)
            last = i
            if table is not None:
                if not math.isnan(course.temperature_degC[i]):
                    temperature = course.temperature_degC[i]
                if not math.isnan(course.angle_rad[i]):
                    angle = course.angle_rad[i]
                if course.columns.shape[0] > 0:
                    columns = last_known(columns, columns_at(course.columns, i))
        outcome[i] = what
        if keep_state:
            for j in range(x.size):
                states[i, j] = x[j]
                stds[i, j] = math.sqrt(P[j, j])
    past[TEMPERATURE], past[ANGLE] = temperature, angle
    for j in range(MOST_COLUMNS):
        past[COLUMNS + j] = columns[j]
    past[OPENS] = 1.0 if opens else 0.0


def nothing_past() -> Float64Array:
    """What a pass remembers beside its belief and `Memory`, before the first sample: (6,), see TEMPERATURE and on."""
    past = np.full(_PAST_SIZE, math.nan)
    past[TEMPERATURE], past[ANGLE], past[OPENS] = REFERENCE_DEGC, 0.0, 0.0
    return past


def _example(*, with_effects: bool) -> tuple[Any, ...]:
    """Arguments of the types that `filter_log` gives."""
    series = np.zeros(0)
    constants = filter_constants(1.0)
    table = NO_EFFECTS.table() if with_effects else None
    run = FilterRun.empty(np.zeros(STATE_SIZE), np.eye(STATE_SIZE), 0)
    memory = memory_of(run.mean, run.covariance, constants, table, mends=False)
    return constants, table, Course.of(series, series, series), run, memory, nothing_past(), 0


filter_pass = Kernel(_filter_pass, _MODULES, lambda: _example(with_effects=False), sizes_known=True)
filter_pass_with_effects = Kernel(_filter_pass, _MODULES, lambda: _example(with_effects=True), "with_effects")
