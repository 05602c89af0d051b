"""Healthy wheels read through a filter: no bristle is named for its noise, and its lag is what it is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.hindsight import belief_of_log, run_of_log
from rw_ekf.identify.noise_colour import independent_readings
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.state import PARAMETERS
from rw_ekf.starting_point import setup_of_record
from rw_ekf.units import RAD_S_PER_RPM
from tools.measure.coverage import Case, run_of

_A = 0.6  # from one reading to the next: a low-pass of 0.2 s
_READINGS_LATE = {"actuator_lag", "speed_averaging", "transport_delay"}


def log_of(case: Case, *, lags: bool) -> WheelLog:
    """Readings of 1 rpm whose noise, and where it lags whose speed too, has passed a low-pass of first order."""
    run = run_of(case)
    n = run.time_s.size
    noise = math.sqrt(1.0 - _A**2) * np.random.default_rng([case.seed, 9]).standard_normal(n) * RAD_S_PER_RPM
    speed = lfilter([1.0 - _A], [1.0, -_A], run.speed_rad_s) if lags else run.speed_rad_s
    reading: Float64Array = speed + lfilter([1.0], [1.0, -_A], noise)
    return WheelLog(
        name="filtered",
        time_s=run.time_s,
        speed_rad_s=reading,
        current_A=run.current_command_A,
        drive="current_command_A",
        command_delay_s=np.zeros(n),
        segment=np.zeros(n, dtype=np.int64),
        rows_read=n,
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_noise_that_goes_on_is_no_bristle(seed: int) -> None:
    """The model is adequate, and the low-pass is told."""
    document = diagnose_log(log_of(Case("identification", 0.0, seed), lags=False)).document()
    assert document["verdict"]["kind"] == "adequate"
    assert any("behind a low-pass of 0." in text for text in document["warnings"])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_the_lag_of_a_filter_is_named_alone(seed: int) -> None:
    """A lag of 0.15 s (0.6 / 0.4 readings) or another reading that is late, and nothing beside it."""
    document = diagnose_log(log_of(Case("identification", 0.0, seed), lags=True)).document()
    (named,) = document["verdict"]["effects"]
    assert named in _READINGS_LATE


def test_sigmas_hold_behind_a_filter() -> None:
    """Identification, eight wheels: NEES of four parameters as it should be; it was 19."""
    nees = []
    for seed in range(6000, 6008):
        case = Case("identification", 0.03, seed)
        course, colour = independent_readings(Course.of_log(log_of(case, lags=False)))
        assert colour is not None
        filtered, setup = run_of_log(course, setup_of_record(course))
        found = belief_of_log(course, setup, filtered)
        off = found.mean[PARAMETERS] - np.array(case.wheel)
        nees.append(float(off @ np.linalg.solve(found.parameter_covariance, off)))
    assert np.mean(nees) < 6.7  # chi-square of 32, one in a hundred
