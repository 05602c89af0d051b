"""Simulation ahead from given states with effects: horizons and free runs (docs/diagnosis.md, "Figures of merit")."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.course import course as _course
from rw_ekf.course.course import Course
from rw_ekf.model.friction import Stribeck
from rw_ekf.wheel.compiled import compile_cached
from rw_ekf.wheel.equations import EQUATIONS
from rw_ekf.wheel.interval import Interval
from rw_ekf.wheel.pieces import effect_interval
from rw_ekf.wheel.table import NO_EFFECTS, EffectSet, EffectTable


def _run_ahead(
    table: EffectTable,
    stribeck: Stribeck,
    course: Course,
    states: Float64Array,
    first: Int64Array,
    last: Int64Array,
    ends: Float64Array,
    path: Float64Array,
) -> None:
    """Simulate from states (m, n) at samples first (m,) to last (m,): ends (m,), and path (n,) if it is not empty."""
    time_s, temperature, angle = course.time_s, course.temperature_degC, course.angle_rad
    pieces, piece_start, first_piece = course.pieces, course.piece_start, course.first_piece
    keep = path.size > 0
    row = np.zeros(table.size)
    state = np.zeros(table.size)
    ended = np.zeros(table.size)
    for j in range(first.size):
        state[:] = states[j]
        if keep:
            path[first[j]] = state[0]
        for i in range(first[j], last[j]):
            interval = Interval(
                time_s[i], time_s[i + 1], temperature[i], angle[i], first_piece[i], piece_start[i], piece_start[i + 1]
            )
            effect_interval(state, table, stribeck, pieces, interval, False, row, ended)
            state[:] = ended
            if keep:
                path[i + 1] = state[0]
        ends[j] = state[0]


def _example() -> tuple[Any, ...]:
    series, numbers = np.zeros(0), np.zeros(0, np.int64)
    return (
        NO_EFFECTS.table(), Stribeck(1.0, 0), Course.of(series, series, series), np.zeros((0, 5)), numbers, numbers,
        series, series,
    )  # fmt: skip


run_ahead = compile_cached(_run_ahead, [*EQUATIONS, _course, sys.modules[__name__]], _example)


def simulate_ahead(
    course: Course,
    effects: EffectSet,
    omega_s: float,
    law: int,
    states: Float64Array,
    first: Int64Array,
    last: Int64Array,
    *,
    keep_path: bool = False,
) -> tuple[Float64Array, Float64Array]:
    """Speeds [rad/s] at samples last (m,) from states (m, n) at first (m,); with keep_path also the way, (n,)."""
    ends = np.zeros(first.size)
    path = np.full(course.samples if keep_path else 0, np.nan)
    run_ahead(effects.table(), Stribeck(omega_s, law), course, states, first, last, ends, path)
    return ends, path
