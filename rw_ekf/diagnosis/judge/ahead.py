"""Simulation ahead from given states with effects: horizons and free runs (docs/diagnosis.md, "Figures of merit")."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.likelihood.one_step import Record
from rw_ekf.wheel.compiled import compile_cached
from rw_ekf.wheel.equations import EQUATIONS
from rw_ekf.wheel.pieces import effect_interval
from rw_ekf.wheel.table import NO_EFFECTS, EffectSet, EffectTable


def _run_ahead(
    table: EffectTable,
    omega_s: float,
    law: int,
    time_s: Float64Array,
    first_piece: Int64Array,
    piece_start: Int64Array,
    begins: Float64Array,
    durations: Float64Array,
    currents: Float64Array,
    temperature: Float64Array,
    angle: Float64Array,
    states: Float64Array,
    first: Int64Array,
    last: Int64Array,
    ends: Float64Array,
    path: Float64Array,
) -> None:
    """Simulate from states (m, n) at samples first (m,) to last (m,): ends (m,), and path (n,) if it is not empty."""
    keep = path.size > 0
    row = np.zeros(table.size)
    state = np.zeros(table.size)
    ended = np.zeros(table.size)
    for j in range(first.size):
        state[:] = states[j]
        if keep:
            path[first[j]] = state[0]
        for i in range(first[j], last[j]):
            effect_interval(
                state, table, omega_s, law, time_s[i], time_s[i + 1], temperature[i], angle[i], begins, durations,
                currents, first_piece[i], piece_start[i], durations.size, False, row, ended,
            )  # fmt: skip
            state[:] = ended
            if keep:
                path[i + 1] = state[0]
        ends[j] = state[0]


def _example() -> tuple[Any, ...]:
    series, numbers = np.zeros(0), np.zeros(0, np.int64)
    return (
        NO_EFFECTS.table(), 1.0, 0, series, numbers, numbers, *[series] * 5, np.zeros((0, 5)), numbers, numbers,
        series, series,
    )  # fmt: skip


run_ahead = compile_cached(_run_ahead, [*EQUATIONS, sys.modules[__name__]], _example)


def simulate_ahead(
    record: Record,
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
    path = np.full(record.data.time_s.size if keep_path else 0, np.nan)
    run_ahead(
        effects.table(), omega_s, law, record.data.time_s, record.first_piece, record.data.pieces.start,
        record.begins_s, record.data.pieces.duration_s, record.data.pieces.current_A, record.temperature_degC,
        record.angle_rad, states, first, last, ends, path,
    )  # fmt: skip
    return ends, path
