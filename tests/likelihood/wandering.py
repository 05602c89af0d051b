"""Runs of a wheel whose speed is also moved by torque that no model has: white acceleration noise."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.model.state import CK13_STATISTICAL, FrictionParameters
from rw_ekf.starting_point import FilterSetup, setup_of_record
from rw_ekf.units import RAD_S_PER_RPM
from tests.truth import fine_trajectory, run_of


def drawn_wheel(seed: int) -> FrictionParameters:
    """A wheel of the default's class: k, b, c within 15 %, break-away 1 to 10 % above Coulomb friction."""
    rng = np.random.default_rng(9000 + seed)
    k, b, c = np.array(CK13_STATISTICAL[:3]) * np.exp(0.15 * rng.uniform(-1.0, 1.0, 3))
    return FrictionParameters(float(k), float(b), float(c), float(c * rng.uniform(1.01, 1.10)))


def current_of(profile: str, seed: int, wheel: FrictionParameters) -> tuple[Float64Array, Float64Array]:
    """Times [s] and currents [A]: a published profile, or one that hardly moves this wheel, at 10 Hz for 300 s."""
    time_s = np.arange(3000, dtype=np.float64) / 10.0
    break_away_A = wheel.static / wheel.motor_gain
    if profile == "weak sine":
        sine: Float64Array = np.sin(2.0 * np.pi * time_s / 21.0)
        return time_s, 1.38 * break_away_A * sine
    if profile == "creep":
        sign: Float64Array = np.sign(np.sin(2.0 * np.pi * time_s / 50.0))
        return time_s, break_away_A * sign * (1.005 + 0.02 * np.abs(np.sin(2.0 * np.pi * time_s / 23.0)))
    run = run_of(profile, seed)
    return run.time_s, run.current_A


def wandering_run(
    profile: str, seed: int, torque_noise_rpm: float, *, offset_share: float = 0.0
) -> tuple[Course, FrictionParameters]:
    """A log with 1 rpm of reading noise and torque noise in rpm per sqrt(s), and the truth.

    offset_share: an undeclared constant torque, in shares of Coulomb friction.
    """
    wheel = drawn_wheel(seed)
    time_s, current_A = current_of(profile, seed, wheel)
    rng = np.random.default_rng(9500 + seed)
    kicks = torque_noise_rpm * RAD_S_PER_RPM * np.sqrt(0.1) * rng.standard_normal(time_s.size)
    driven_A = current_A + offset_share * wheel.coulomb / wheel.motor_gain
    speed = fine_trajectory(wheel, time_s, driven_A, kicks_rad_s=kicks)
    reading = speed + RAD_S_PER_RPM * rng.standard_normal(time_s.size)
    return Course.of(time_s, reading, current_A), wheel


@lru_cache(maxsize=192)
def wandering_setup(
    profile: str, seed: int, torque_noise_rpm: float, offset_share: float
) -> tuple[Course, FrictionParameters, FilterSetup]:
    """The same, and the setup that its record tells: made once for all tests of one process."""
    course, wheel = wandering_run(profile, seed, torque_noise_rpm, offset_share=offset_share)
    return course, wheel, setup_of_record(course)
