"""The model run free along a course, no reading looked at after the first: speeds, and their sensitivity."""

from __future__ import annotations

import sys
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array, by_identity
from rw_ekf.compiled import Kernel
from rw_ekf.course import course as _course
from rw_ekf.course.course import Course
from rw_ekf.model.friction import FrictionCurve, Stribeck
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, SPEED, STATE_SIZE, STATIC, VISCOUS
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet, EffectTable
from rw_ekf.wheel.equations import EQUATIONS
from rw_ekf.wheel.interval import interval_after
from rw_ekf.wheel.pieces import effect_interval, row_size
from rw_ekf.wheel.transition import interval


class Stretch(NamedTuple):
    """Samples first <= i < last that one free run covers, from its own initial speed."""

    first: int
    last: int


def stretches(course: Course, max_gap_s: float) -> list[Stretch]:
    """Cut a course where a segment changes or time leaps by more than max_gap_s, dropping leading missing speeds."""
    n = course.samples
    if n == 0:
        return []
    cut = np.flatnonzero((np.diff(course.segment) != 0) | (np.diff(course.time_s) > max_gap_s)) + 1
    edges = [0, *(int(i) for i in cut), n]
    found = []
    for a, b in pairwise(edges):
        present = np.flatnonzero(np.isfinite(course.speed_rad_s[a:b]))
        if present.size:
            found.append(Stretch(a + int(present[0]), b))
    return found


@by_identity
class FreeRun(NamedTuple):
    """What k free runs over n samples give; path and jacobian have no rows where they were not requested."""

    ends_rad_s: Float64Array  # (k,) speed at the last sample of each
    path_rad_s: Float64Array  # (n,) NaN outside of the runs
    jacobian: Float64Array  # (n, m) of the path by the state that its run began with


def _run(
    table: EffectTable | None, stribeck: Stribeck, course: Course, states: Any, first: Any, last: Any, out: FreeRun,
    state: Any, ended: Any, row: Any,
) -> None:  # fmt: skip
    """Run from states (k, m) at samples first (k,) to last (k,), both included. Without effects table is None.

    state, ended (m,), row (`row_size`,): scratch.
    """
    pieces, piece_start = course.pieces, course.piece_start
    ends, path, jacobian = out
    keep = path.size > 0
    sloped = jacobian.shape[0] > 0
    n = states.shape[1]
    for j in range(first.size):
        for m in range(n):
            state[m] = states[j, m]
        curve = FrictionCurve(state[VISCOUS], state[COULOMB], state[STATIC], stribeck.omega_s, stribeck.law)
        if keep:
            path[first[j]] = state[SPEED]
        if sloped:
            for m in range(n):
                jacobian[first[j], m] = 1.0 if m == SPEED else 0.0
        for i in range(first[j], last[j]):
            if table is None:
                state[SPEED], row[SPEED], row[MOTOR_GAIN], row[VISCOUS], row[COULOMB], row[STATIC] = interval(
                    state[SPEED], state[MOTOR_GAIN], curve, pieces, piece_start[i], piece_start[i + 1], sloped
                )
            if table is not None:
                effect_interval(state, table, stribeck, pieces, interval_after(course, i), sloped, row, ended)
                for m in range(n):
                    state[m] = ended[m]
            if keep:
                path[i + 1] = state[SPEED]
            if sloped:
                jacobian[i + 1, SPEED] = row[SPEED] * jacobian[i, SPEED]
                for m in range(1, n):
                    jacobian[i + 1, m] = row[SPEED] * jacobian[i, m] + row[m]
        ends[j] = state[SPEED]


def _example(*, with_effects: bool) -> tuple[Any, ...]:
    series, numbers, whole = np.zeros(0), np.zeros(0, np.int64), np.zeros((0, STATE_SIZE))
    table = NO_EFFECTS.table() if with_effects else None
    course = Course.of(series, series, series)
    out = FreeRun(series, series, whole)
    scratch = np.zeros(STATE_SIZE), np.zeros(STATE_SIZE), np.zeros(row_size(STATE_SIZE))
    return table, Stribeck(1.0, 0), course, whole, numbers, numbers, out, *scratch


_MODULES = [*EQUATIONS, _course, sys.modules[__name__]]
run_free = Kernel(_run, _MODULES, lambda: _example(with_effects=False), sizes_known=True)
run_free_with_effects = Kernel(_run, _MODULES, lambda: _example(with_effects=True), "with_effects")


def free_run(
    course: Course,
    effects: EffectSet,
    stribeck: Stribeck,
    states: Float64Array,
    first: Int64Array,
    last: Int64Array,
    *,
    keep_path: bool = False,
    with_jacobian: bool = False,
) -> FreeRun:
    """Run from states (k, m) at samples first (k,) to samples last (k,), both included.

    The jacobian holds for the five states and static effects alone: the flow does not know how the speed depends on a
    hidden state, a delay, a window or a Stribeck shape.
    """
    n, m = course.samples, states.shape[1]
    kept = n if keep_path or with_jacobian else 0
    out = FreeRun(np.zeros(first.size), np.full(kept, np.nan), np.zeros((n if with_jacobian else 0, m)))
    start, begin, end = map(np.ascontiguousarray, (states, first, last))
    scratch = np.zeros(m), np.zeros(m), np.zeros(row_size(m))
    if m > STATE_SIZE:
        run_free_with_effects(effects.table(), stribeck, course, start, begin, end, out, *scratch)
    else:
        run_free(None, stribeck, course, start, begin, end, out, *scratch)
    return out
