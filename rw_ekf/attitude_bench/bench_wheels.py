"""The wheel of one seed: drawn, aged, and what is known of it beforehand: by the filter, and from the data sheet."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from rw_ekf.attach.simulated import simulated_plant, simulated_record
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.course.course import Course
from rw_ekf.filter.belief import Belief, prior_around
from rw_ekf.filter.constants import FilterConstants, filter_constants
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.state import CK13_DETERMINISTIC, CK13_STATISTICAL, FrictionParameters
from rw_ekf.units import rad_s_from_rpm

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.plant_parameters import PlantParameters

_LEARNED_ON = "identification"
_RATE_HZ = 10.0
_DETERMINISTIC_SHARE = FrictionParameters(
    *(d / s for d, s in zip(CK13_DETERMINISTIC, CK13_STATISTICAL, strict=True))
)  # how far the deterministic method is off where the statistical one is right, [CK13] Table 1


def nominal(scenario: Scenario) -> FrictionParameters:
    """The parameters that a scenario names."""
    wheel = scenario.wheel
    return FrictionParameters(wheel.motor_gain, wheel.viscous, wheel.coulomb, wheel.static)


def drawn_wheel(scenario: Scenario, seed: int) -> PlantParameters:
    """The true wheel of a seed: gain and frictions drawn within the spread, then the effects.

    The excess of the break-away friction is drawn apart from the Coulomb friction, so that it never lies below it.
    """
    share = 0.01 * scenario.wheel.spread_percent
    factors = 1.0 + share * np.random.default_rng([seed, 77]).uniform(-1.0, 1.0, 4)
    named = nominal(scenario)
    coulomb = named.coulomb * factors[2]
    drawn = FrictionParameters(
        named.motor_gain * factors[0],
        named.viscous * factors[1],
        coulomb,
        coulomb + (named.static - named.coulomb) * factors[3],
    )
    return simulated_plant(drawn, rad_s_from_rpm(scenario.wheel.stribeck_speed_rpm), list(scenario.wheel.effects))


def aged(plant: PlantParameters, percent: float, share_of_run: float) -> PlantParameters:
    """The wheel at a share of the run: friction grown, motor gain fallen by a fifth of it."""
    grown = 1.0 + 0.01 * percent * share_of_run
    return plant._replace(
        viscous=plant.viscous * grown,
        coulomb=plant.coulomb * grown,
        static=plant.static * grown,
        motor_gain=plant.motor_gain * (1.0 - 0.2 * (grown - 1.0)),
    )


def deterministic(plant: PlantParameters) -> FrictionParameters:
    """What the deterministic method of [CK13] Table 1 would say of a wheel: off by the same shares as there."""
    truth = (plant.motor_gain, plant.viscous, plant.coulomb, plant.static)
    return FrictionParameters(*(share * value for share, value in zip(_DETERMINISTIC_SHARE, truth, strict=True)))


def constants_of(scenario: Scenario, noise_rpm: float, rate_hz: float) -> FilterConstants:
    """The filter's constants on the bench."""
    return filter_constants(
        rad_s_from_rpm(scenario.wheel.stribeck_speed_rpm),
        speed_noise_rad_s=rad_s_from_rpm(noise_rpm),
        acceleration_noise=max(rad_s_from_rpm(scenario.wheel.torque_noise_rpm_per_sqrt_s), rad_s_from_rpm(0.03)),
        scale=nominal(scenario),
        nominal_period_s=1.0 / rate_hz,
    )


@lru_cache(maxsize=64)
def identification_log(scenario: Scenario, noise_rpm: float, seed: int) -> WheelLog:
    """Readings of the seed's wheel under the identification profile, 600 s at 10 Hz, before the attitude run."""
    times, currents = sample_profile(make_profile(_LEARNED_ON), _RATE_HZ)
    run = simulated_record(
        drawn_wheel(scenario, seed),
        np.array(currents),
        np.array(times),
        speed_noise_rad_s=rad_s_from_rpm(noise_rpm),
        torque_noise=rad_s_from_rpm(scenario.wheel.torque_noise_rpm_per_sqrt_s),
        seed=10_000 + seed,
    )
    n = run.time_s.size
    return WheelLog(
        name=f"{_LEARNED_ON} of seed {seed}",
        time_s=run.time_s,
        speed_rad_s=run.measured_speed_rad_s,
        current_A=run.current_command_A,
        drive="current_command_A",
        command_delay_s=np.zeros(n),
        segment=np.zeros(n, np.int64),
        channels={"temperature_degC": run.temperature_degC, "angle_rad": run.angle_rad},
        rows_read=n,
        in_rpm=True,
    )


def identification_course(scenario: Scenario, noise_rpm: float, seed: int) -> Course:
    """The same record, as a filter reads it."""
    return Course.of_log(identification_log(scenario, noise_rpm, seed))


@lru_cache(maxsize=64)
def learned(scenario: Scenario, noise_rpm: float, seed: int) -> Belief:
    """What the EKF itself estimated of the seed's wheel, from a wide prior around the nominal one."""
    course = identification_course(scenario, noise_rpm, seed)
    prior = prior_around(nominal(scenario))
    found = filter_log(course, constants_of(scenario, noise_rpm, 10.0), prior.mean, prior.covariance)
    return Belief(found.mean, found.covariance)
