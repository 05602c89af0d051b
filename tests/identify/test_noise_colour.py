"""Noise that goes on from one reading to the next: found, measured, and thinned until it is none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.identify.noise_colour import NoiseColour, independent_readings
from rw_ekf.identify.record_scale import measure, speed_noise_of
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.units import RAD_S_PER_RPM
from tests.truth import fine_trajectory
from tools.measure.coverage import PROFILES, Case, run_of
from tools.measure.runs import Run


def stairs(rate_hz: float, duration_s: float, seed: int = 1) -> Run:
    """A wheel under currents that are held for twenty seconds, or a tenth of the record; noise-free."""
    time_s = np.arange(0.0, duration_s, 1.0 / rate_hz)
    levels = np.random.default_rng(seed).uniform(-0.15, 0.15, 1000)
    current_A = levels[(time_s / min(20.0, 0.1 * duration_s)).astype(int)]
    speed = fine_trajectory(CK13_STATISTICAL, time_s, current_A)
    return Run(time_s, current_A, speed, speed, CK13_STATISTICAL)


def white(run: Run, seed: int = 2) -> Float64Array:
    return RAD_S_PER_RPM * np.random.default_rng(seed).standard_normal(run.time_s.size)


def colour_of(run: Run, reading: Float64Array) -> NoiseColour | None:
    return independent_readings(Course.of(run.time_s, reading, run.current_A))[1]


@pytest.mark.parametrize("profile", PROFILES)
def test_independent_readings_are_left_as_they_are(profile: str) -> None:
    """No profile, with or without torque noise, is thinned: six wheels each."""
    for seed in range(6):
        run = run_of(Case(profile, (0.0, 0.03, 0.1)[seed % 3], seed))
        course = Course.of(run.time_s, run.measured_speed_rad_s, run.current_command_A)
        thinned, colour = independent_readings(course)
        assert thinned is course
        assert colour is None


@pytest.mark.parametrize("lags", [True, False])
@pytest.mark.parametrize(
    ("rate_hz", "duration_s", "time_constant_s"),
    [(10.0, 600.0, 0.08), (10.0, 600.0, 0.2), (50.0, 300.0, 0.1), (100.0, 120.0, 0.1), (1000.0, 30.0, 0.005)],
)
def test_a_low_pass_is_known_by_its_noise(
    rate_hz: float, duration_s: float, time_constant_s: float, *, lags: bool
) -> None:
    """Its time constant is found within a quarter, whether or not the speed passes it; what is left is independent."""
    run = stairs(rate_hz, duration_s)
    a = math.exp(-1.0 / rate_hz / time_constant_s)
    noise = lfilter([math.sqrt(1.0 - a * a)], [1.0, -a], white(run))
    speed = lfilter([1.0 - a], [1.0, -a], run.speed_rad_s) if lags else run.speed_rad_s
    found = colour_of(run, speed + noise)
    assert found is not None
    assert not found.running_mean
    assert found.seconds == pytest.approx(time_constant_s, rel=0.25)
    assert a**found.stride < 0.15


@pytest.mark.parametrize("count", [2, 3, 5, 8])
def test_a_running_mean_is_known_by_its_noise(count: int) -> None:
    """The number of readings that a logger averages is found as it is."""
    run = stairs(10.0, 600.0)
    found = colour_of(run, lfilter(np.ones(count) / count, [1.0], run.speed_rad_s + white(run)))
    assert found is not None
    assert found.running_mean
    assert found.stride == count
    assert found.seconds == pytest.approx(0.1 * count)


def test_a_speed_from_differences_of_positions_is_not_thinned() -> None:
    """Its noise is opposite from one reading to the next: taken for independent it is only overestimated."""
    run = stairs(10.0, 600.0)
    assert colour_of(run, run.speed_rad_s + np.diff(white(run), prepend=0.0)) is None


def test_a_torque_that_wanders_is_no_colour() -> None:
    """The speed wanders with it, but what one reading is wrong by says nothing of the next."""
    run = stairs(10.0, 600.0)
    torque = np.cumsum(0.03 * RAD_S_PER_RPM * np.random.default_rng(3).standard_normal(run.time_s.size)) * 0.1
    assert colour_of(run, run.speed_rad_s + torque + white(run)) is None


@pytest.mark.parametrize("missing", [0.2, 0.95])
def test_readings_with_many_holes_say_nothing_of_their_colour(missing: float) -> None:
    """No stretch is whole: nothing is thinned, and nothing is raised."""
    run = stairs(10.0, 600.0)
    reading = np.where(np.random.default_rng(4).random(run.time_s.size) < missing, np.nan, run.speed_rad_s + white(run))
    assert colour_of(run, reading) is None


def test_the_noise_of_thinned_readings_is_read_off_them() -> None:
    """One row in five has a speed: its noise is found, not a usual one, and the wheel is recognised."""
    run = stairs(10.0, 600.0)
    reading = np.where(np.arange(run.time_s.size) % 5 == 0, run.speed_rad_s + 3.0 * white(run), np.nan)
    found = speed_noise_of(reading, np.zeros(run.time_s.size, np.int64))
    assert found == pytest.approx(3.0 * RAD_S_PER_RPM, rel=0.2)
    assert measure(Course.of(run.time_s, reading, run.current_A)).like_default_wheel


def quick(rows_a_level: int, late: int, seed: int = 5) -> Course:
    """A motor that settles within 0.12 s, k 70, b 25, c 14, rows of 20 ms, two levels; commands act rows late."""
    draws, n, step_s = np.random.default_rng(seed), 4000, 0.02
    level = np.repeat(draws.integers(0, 2, n // rows_a_level + 1), rows_a_level)[:n]
    current = np.where(level, 2.7, 1.45)
    end = (70.0 * np.concatenate((np.full(late, current[0]), current[: n - late])) - 14.0) / 25.0
    fading = math.exp(-25.0 * step_s)
    speed: Float64Array = np.full(n, end[0])
    for i in range(n - 1):
        speed[i + 1] = end[i] + (speed[i] - end[i]) * fading
    return Course.of(step_s * np.arange(n, dtype=np.float64), speed + 0.02 * draws.standard_normal(n), current)


@pytest.mark.parametrize(("rows_a_level", "late"), [(1, 0), (2, 0), (5, 1), (7, 1), (8, 1), (8, 0), (6, 2)])
def test_an_answer_to_the_command_is_no_colour(rows_a_level: int, late: int) -> None:
    """A machine that settles within a few rows, its commands in time or late: no reading is left out."""
    course = quick(rows_a_level, late)
    assert independent_readings(course)[0] is course


@pytest.mark.parametrize("rows_a_level", [1, 2])
def test_an_answer_to_the_command_is_no_noise(rows_a_level: int) -> None:
    """Under a command that changes every row or two the readings' noise is found within a tenth, the gain as well."""
    scale = measure(quick(rows_a_level, 0))
    assert scale.constants.speed_noise_rad_s == pytest.approx(0.02, rel=0.1)
    assert scale.rough.motor_gain == pytest.approx(70.0, rel=0.1)


def test_thinned_readings_walk_through_the_clock_of_a_command() -> None:
    """Of a mean of eight, the readings kept are eight rows apart or more, and at every phase of eight rows alike."""
    run = stairs(10.0, 600.0)
    reading = lfilter(np.ones(8) / 8, [1.0], run.speed_rad_s + white(run))
    course, colour = independent_readings(Course.of(run.time_s, reading, run.current_A))
    assert colour is not None
    kept = np.flatnonzero(np.isfinite(course.speed_rad_s))
    assert np.diff(kept).min() >= colour.stride
    assert np.bincount(kept % 8, minlength=8).min() > 0.5 * kept.size / 8
