"""The figures of a run are those that a ruler would find on it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.attitude_bench.bench_run import BenchRun
from rw_ekf.attitude_bench.metrics import metrics_of


def drawn_run(error_deg: Float64Array, current_A: Float64Array, reversal_s: float = 50.0) -> BenchRun:
    """A run of 10 Hz with a given error and current; the wheel slows down evenly through zero."""
    time_s = np.linspace(0.0, 0.1 * (error_deg.size - 1), error_deg.size)
    wheel = np.asarray((reversal_s - time_s) * 0.3)
    off = np.asarray(error_deg * np.pi / 180.0)
    return BenchRun(time_s, off, wheel, np.zeros(time_s.size), current_A, stood_s=1.25)


def test_the_figures_of_a_drawn_course_are_read_off_it() -> None:
    """A triangle of 0.8 deg that is below 0.1 deg 35 s after the reversal; a current that jumps between two values."""
    time_s = np.arange(2000) * 0.1
    error = np.full(time_s.size, 0.02)
    error[500:900] = np.interp(time_s[500:900], [50.0, 60.0, 90.0], [0.02, -0.8, 0.02])
    current = np.where(np.arange(time_s.size) % 2 == 0, 0.1, -0.3)
    found = metrics_of(drawn_run(error, current))
    assert found.peak_deg == pytest.approx(0.8)
    assert found.steady_deg == pytest.approx(0.02)
    assert found.recover_s == pytest.approx(35.7, abs=0.3)
    assert found.stop_s == 1.25
    assert found.effort_A_s == pytest.approx(120.0 * 0.2, rel=1e-2)
    assert found.chatter_A_per_s == pytest.approx(4.0, rel=1e-2)


def test_what_never_recovers_has_no_time_to_recover() -> None:
    """An error that stays at half a degree."""
    found = metrics_of(drawn_run(np.full(2000, 0.5), np.zeros(2000)))
    assert math.isnan(found.recover_s)
    assert found.peak_deg == pytest.approx(0.5)


def test_a_wheel_that_never_reverses_has_no_figures() -> None:
    """All are NaN, which JSON has as null."""
    found = metrics_of(drawn_run(np.full(300, 0.5), np.zeros(300), reversal_s=1e4))
    assert all(math.isnan(value) for value in found)
