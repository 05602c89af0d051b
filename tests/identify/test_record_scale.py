"""What a record says of itself: noise, size, and whether it looks like the default wheel."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.identify.record_scale import measure, speed_noise_of
from rw_ekf.model.state import FrictionParameters
from rw_ekf.starting_point import setup_of_record
from rw_ekf.units import RAD_S_PER_RPM
from tests.truth import fine_trajectory, run_of
from tools.measure.runs import PUBLISHED, Run


@pytest.mark.parametrize("noise_rpm", [1.0, 5.0])
@pytest.mark.parametrize("profile", PUBLISHED)
def test_the_noise_of_a_record_is_read_off_it(profile: str, noise_rpm: float) -> None:
    """Third differences give the readings' noise within 10 % on every published profile; the wheel is recognised."""
    scale = measure(run_of(profile, 1, noise_rpm=noise_rpm).course)
    assert scale.constants.speed_noise_rad_s / RAD_S_PER_RPM == pytest.approx(noise_rpm, rel=0.1)
    assert scale.like_default_wheel
    assert scale.prior is DEFAULT_PRIOR


def carriage(seed: int = 1) -> Run:
    """A carriage of 95 kg driven by newtons at 0.1 m/s and 1 kHz, dry friction 20 N, viscous 200 N s/m."""
    parameters = FrictionParameters(1.0 / 95.0, 200.0 / 95.0, 20.0 / 95.0, 22.0 / 95.0)
    time_s = np.arange(0.0, 24.0, 1e-3)
    force_N = 45.0 * np.sign(np.sin(2.0 * np.pi * time_s / 6.0)) * (0.7 + 0.3 * np.sin(time_s))
    speed = fine_trajectory(parameters, time_s, force_N, omega_s=0.005)
    reading = speed + 2e-4 * np.random.default_rng(seed).standard_normal(time_s.size)
    return Run(time_s, force_N, speed, reading, parameters)


def test_a_foreign_plant_is_not_taken_for_the_default_wheel() -> None:
    """A carriage in metres and newtons is flagged; its noise is right within 10 % and the prior covers the truth."""
    run = carriage()
    scale = measure(run.course)
    assert not scale.like_default_wheel
    assert scale.constants.speed_noise_rad_s == pytest.approx(2e-4, rel=0.1)
    sigmas = (np.array(run.parameters) - scale.prior.mean[1:]) / scale.prior.std[1:]
    assert np.max(np.abs(sigmas)) < 2.0
    assert 0.5 < scale.rough.motor_gain / run.parameters.motor_gain < 2.0
    assert 0.0002 < scale.constants.stribeck.omega_s < 0.02


def test_a_wheel_in_the_wrong_units_is_not_taken_for_the_default_wheel() -> None:
    """The same wheel with its current in milliamperes is flagged."""
    run = run_of("P2", 2)
    assert not measure(Course.of(run.time_s, run.reading_rad_s, 1000.0 * run.current_A)).like_default_wheel


@pytest.mark.parametrize("seed", [0, 1])
def test_a_motor_fed_with_a_voltage_is_the_same_in_whatever_unit_that_is(seed: int) -> None:
    """Volts saturate, act late and have a dead zone, so that no fit is good; a gain like a wheel's is chance then."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(0.0, 14.0, 0.02)
    volts = np.repeat(rng.uniform(0.5, 5.0, 28), 25)[: time_s.size]
    late = np.concatenate((volts[:1], volts[:-1]))
    acts = 3.2 * np.tanh(np.maximum(late - 0.3, 0.0) / 2.5)
    speed = fine_trajectory(FrictionParameters(40.0, 2.0, 14.0, 17.0), time_s, acts, omega_s=0.5)
    reading = np.round((speed + 0.3 * rng.standard_normal(time_s.size)) / 0.9) * 0.9
    reported = []
    for per_volt in (1.0, 0.3, 0.1):
        setup = setup_of_record(Course.of(time_s, reading, per_volt * volts))
        assert setup.inertia_kg_m2 is None  # nobody knows it, and no torque is told
        assert setup.fit_of_record is not None
        reported.append(np.array(setup.fit_of_record.parameters) * (per_volt, 1.0, 1.0, 1.0))
    assert np.allclose(reported, reported[0], rtol=0.02)


def test_readings_on_a_coarse_grid_have_the_grids_noise() -> None:
    """Where most readings repeat, the lattice step stands in: of the order of d / sqrt(12)."""
    run = run_of("S2", 1)
    grid = 20.0 * RAD_S_PER_RPM
    noise = speed_noise_of(np.round(run.speed_rad_s / grid) * grid, np.zeros(run.time_s.size, np.int64))
    assert noise is not None
    assert 0.3 * grid / np.sqrt(12.0) < noise < 3.0 * grid / np.sqrt(12.0)


@pytest.mark.parametrize(
    "speed",
    [np.zeros(100), np.full(100, np.nan), np.full(100, 3.0), np.zeros(0), np.zeros(5)],
    ids=["at rest", "nothing read", "constant", "empty", "five rows"],
)
def test_a_record_that_says_nothing_leaves_the_default_wheel(speed: Float64Array) -> None:
    """No reading, no variation or no length: the defaults, and no exception."""
    course = Course.of(np.linspace(0.0, 0.1 * speed.size, speed.size), speed, np.zeros(speed.size))
    scale = measure(course)
    assert scale.like_default_wheel
    assert scale.constants.speed_noise_rad_s > 0.0
