"""A regulated drive that is measured: at its limits the sensor's noise is no law, elsewhere a noise of known size."""

from __future__ import annotations

import numpy as np
import pytest

import rw_ekf
from rw_ekf.diagnosis.prepare.current_levels import limits_of
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.likelihood.levels import CurrentLevels
from tests.diagnosis.speed_loop import log_of, regulated

SENSOR_A = 0.003


def measured(seed: int) -> rw_ekf.Log:
    """A healthy wheel whose log has the current that a sensor has read, and no command."""
    time_s, reading, current_A = regulated(seed)
    sensor = SENSOR_A * np.random.default_rng([seed, 1]).standard_normal(time_s.size)
    return log_of(time_s, reading, current_A + sensor, "current_A")


def test_both_limits_and_the_noise_are_found() -> None:
    """Within four standard deviations of their means; no row in between is taken for one at a limit."""
    _, _, current_A = regulated(1)
    sensor = SENSOR_A * np.random.default_rng(2).standard_normal(current_A.size)
    found = limits_of(current_A + sensor, np.zeros(current_A.size, dtype=np.int64))
    assert found is not None
    assert found.noise_A == pytest.approx(SENSOR_A, rel=0.05)
    assert np.all(np.abs(found.level_A - [-0.2, 0.2]) < 4.0 * SENSOR_A / np.sqrt(found.rows))
    assert np.all(np.abs(current_A[found.of_row >= 0]) > 0.185)
    assert np.array_equal(found.current_A[found.of_row < 0], (current_A + sensor)[found.of_row < 0])


@pytest.mark.parametrize("noise_A", [0.0, SENSOR_A])
def test_a_current_that_only_comes_near_to_its_largest_has_no_limits(noise_A: float) -> None:
    """Sums of sines with a sensor's noise; nor has a drive at its limits without one, which is a command."""
    time_s, random = np.arange(4000) / 10.0, np.random.default_rng(3)
    smooth = 0.1 * np.sin(0.3 * time_s) + 0.1 * np.sin(0.071 * time_s) + noise_A * random.standard_normal(4000)
    assert limits_of(smooth, np.zeros(4000, dtype=np.int64)) is None
    _, _, command_A = regulated(1)
    assert limits_of(command_A, np.zeros(command_A.size, dtype=np.int64)) is None


def test_the_sensors_noise_moves_what_does_not_stand_at_a_limit() -> None:
    """The intervals off the limits are known to be driven with k sigma more or less, and the fit needs no torque noise.

    Taken as read, all intervals had one, and the limits a gain that follows the size of the current.
    """
    prepared = prepare(source_of([measured(1)]), None, None, "blocks")
    levels = prepared.record.levels
    assert isinstance(levels, CurrentLevels)
    assert levels.unsteady_rad_s2 == pytest.approx(15.2 * SENSOR_A, rel=0.06)
    assert np.array_equal(levels.variance(np.ones(prepared.course.samples))[1:] > 0.0, levels.of_sample[:-1] < 0)
    assert prepared.base.noise.ratio * prepared.base.noise.variance < 0.2 * (levels.unsteady_rad_s2 / 10.0) ** 2


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_healthy_wheel_under_a_measured_loop_is_adequate(seed: int) -> None:
    """Nothing is named of a wheel that a controller drives into its limits; its gain is within four of its sigmas."""
    reported = rw_ekf.diagnose(measured(seed))
    assert reported.verdict["kind"] == "adequate", reported.verdict["statement"]
    gain = reported.document()["parameters"]["before"]["motor_gain"]
    assert gain["value"] == pytest.approx(15.2, abs=4.0 * gain["std"])
