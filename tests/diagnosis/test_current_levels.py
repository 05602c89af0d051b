"""A measured current with a noise of its own, around levels: whose noise it is, and what comes of it."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import numpy as np
import pytest

import rw_ekf
from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.prepare.current_levels import levels_of
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of

RATE_HZ, FINER, GAIN = 200, 80, 350.0
LEVELS_A = (-0.9, -0.3, 0.3, 0.9)


def plateaus(rng: np.random.Generator, rows: int, each: int = 100) -> Float64Array:
    """A current (n,) that stands at one of four levels for half a second, by chance."""
    return np.repeat(rng.choice(LEVELS_A, size=rows // each + 1), each)[:rows]


def motor(current_A: Float64Array, torque: Callable[[float], float] = lambda current: GAIN * current) -> Float64Array:
    """Speeds (n,) of an independent motor: Euler's method at 62 us, and a wheel that sticks at 0."""
    step, speed, found = 1.0 / (RATE_HZ * FINER), 0.0, np.empty(current_A.size)
    for i, drive in enumerate(map(torque, current_A.tolist())):
        found[i] = speed
        for _ in range(FINER):
            if speed == 0.0:
                speed = step * (drive - math.copysign(34.0, drive)) if abs(drive) > 34.0 else 0.0
                continue
            friction = 30.0 + 4.0 * math.exp(-((speed / 3.0) ** 2))
            further = speed + step * (drive - speed - math.copysign(friction, speed))
            speed = 0.0 if further * speed < 0.0 else further
    return found


def log_of(current_A: Float64Array, speed_rad_s: Float64Array, rng: np.random.Generator, noise_A: float) -> rw_ekf.Log:
    """What a laboratory logs: speeds of .1 rad/s, and a current that a sensor has read."""
    rows = current_A.size
    return rw_ekf.read(
        {
            "time_s": np.arange(rows) / RATE_HZ,
            "speed_rad_s": speed_rad_s + rng.normal(0.0, 0.1, rows),
            "current_A": current_A + rng.normal(0.0, noise_A, rows),
        }
    )


@pytest.mark.slow
def test_a_sensors_noise_is_no_law_of_the_current() -> None:
    """Of .4 % of the current: healthy motors had a gain by the size of the current, of -16 to +18 % at .98."""
    rng = np.random.default_rng(0)
    current_A = plateaus(rng, 8000)
    reported = rw_ekf.diagnose(log_of(current_A, motor(current_A), rng, noise_A=0.004))
    assert reported.verdict["kind"] == "adequate", reported.verdict["statement"]
    assert any("noise of its own" in text for text in reported.document()["warnings"])
    gain = reported.document()["parameters"]["before"]["motor_gain"]
    assert gain["value"] == pytest.approx(GAIN, abs=4.0 * gain["std"])


@pytest.mark.slow
def test_a_law_of_the_current_is_found_through_its_noise() -> None:
    """A motor whose gain falls by a tenth at its largest current has that named, and no more."""
    rng = np.random.default_rng(3)
    current_A = plateaus(rng, 8000) * np.repeat(rng.uniform(0.4, 1.0, 80), 100)
    saturated = motor(current_A, lambda current: GAIN * current * (1.0 - 0.12 * current * current))
    reported = rw_ekf.diagnose(log_of(current_A, saturated, rng, noise_A=0.004))
    assert reported.verdict["effects"] in (["motor_saturation"], ["learned_law"]), reported.verdict["statement"]
    document = reported.document()
    assert document["after"]["free_run_rms_rpm"] < 0.2 * document["before"]["free_run_rms_rpm"]


@pytest.mark.slow
def test_a_model_knows_what_a_filter_meets_that_reads_the_noise() -> None:
    """A motor with a constant torque: the model that is written is consistent on its next record, as it is read.

    What the sensor adds is no torque, and yet is one to a filter; without it NIS was 1.13 there.
    """
    rng = np.random.default_rng(6)
    currents_A = [plateaus(rng, 8000) for _ in range(2)]
    logs = [
        log_of(current_A, motor(current_A, lambda current: GAIN * current - 6.0), rng, noise_A=0.004)
        for current_A in currents_A
    ]
    reported = rw_ekf.diagnose(logs[0])
    assert reported.verdict["effects"] == ["offset_torque"], reported.verdict["statement"]
    assert reported.model is not None
    (replayed,) = rw_ekf.replay(logs[1], model=reported.model).document()["logs"]
    assert replayed["innovation"]["nis_mean"] == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_a_torque_is_as_uncertain_as_the_levels_that_it_is_told_beside() -> None:
    """Four levels, each known to .09 mA, beside a torque of 17 mA: off by no more than its sigma says.

    With the levels taken for certain it was 23 sigma off.
    """
    rng = np.random.default_rng(9)
    current_A = plateaus(rng, 8000)
    log = log_of(current_A, motor(current_A, lambda current: GAIN * current - 6.0), rng, noise_A=0.004)
    reported = rw_ekf.diagnose(log).verdict
    assert reported["effects"] == ["offset_torque"], reported["statement"]
    ((share, std),) = re.findall(r"constant torque of ([\d.]+) \+- ([\d.]+) % of Coulomb", reported["statement"])
    assert float(share) == pytest.approx(20.0, abs=4.0 * float(std))
    assert float(std) < 0.15


def test_a_current_that_the_motor_felt_stays_as_it_was_read() -> None:
    """A drive that is unsteady by a tenth of an ampere from row to row, and a sensor that shows it."""
    rng = np.random.default_rng(5)
    current_A = plateaus(rng, 8000) + rng.normal(0.0, 0.1, 8000)
    log = log_of(current_A, motor(current_A), rng, noise_A=0.0)
    assert levels_of(log.current_A, log.segment) is not None
    prepared = prepare(source_of([log]), None, None, "blocks")
    assert np.array_equal(prepared.current_A, log.current_A)


def test_levels_that_are_met_again_are_known_as_well_as_all_their_rows_say() -> None:
    """Four of them, each within four standard deviations of two thousand readings' mean."""
    rng = np.random.default_rng(1)
    true = plateaus(rng, 8000)
    found = levels_of(true + rng.normal(0.0, 0.004, true.size), np.zeros(true.size, dtype=np.int64))
    assert found is not None
    assert found.noise_A == pytest.approx(0.004, rel=0.05)
    assert found.level_A == pytest.approx(LEVELS_A, abs=4.0 * 0.004 / math.sqrt(1500.0))
    assert np.abs(found.current_A - true).max() < 0.001


def test_rows_on_their_way_between_levels_are_at_none() -> None:
    """Two levels, and from one to the other in three rows: these stay as they were read, and are no levels themselves.

    Each was one, known for certain; more than 24 let no level's error be integrated out, and a healthy wheel that a
    controller keeps at its limits had viscous friction that differs by direction, by 6.8 sigma.
    """
    rng = np.random.default_rng(8)
    true = np.tile(np.concatenate((np.full(40, 0.2), [0.11, 0.02, -0.07], np.full(40, -0.2), [-0.1, 0.03, 0.12])), 40)
    on_the_way = np.abs(true) < 0.15
    read = true + rng.normal(0.0, 0.003, true.size)
    found = levels_of(read, np.zeros(true.size, dtype=np.int64))
    assert found is not None
    assert found.level_A == pytest.approx([-0.2, 0.2], abs=0.001)
    assert np.array_equal(found.of_row < 0, on_the_way)
    assert np.array_equal(found.current_A[on_the_way], read[on_the_way])


@pytest.mark.parametrize(
    "shape",
    [
        lambda t: np.round(np.sin(0.7 * t)),  # steps without a noise: a command
        lambda t: np.sin(2.0 * t) + 0.3 * np.sin(7.1 * t),
        lambda t: 0.002 * t + 0.5 * np.sign(np.sin(0.3 * t)),  # slopes
    ],
)
def test_what_does_not_stand_has_no_levels(shape: Callable[[Float64Array], Float64Array]) -> None:
    """Nor has what has no noise."""
    time_s = np.arange(8000) / RATE_HZ
    current_A = shape(time_s)
    if np.unique(current_A).size > 10:
        current_A = current_A + np.random.default_rng(2).normal(0.0, 0.004, time_s.size)
    assert levels_of(current_A, np.zeros(time_s.size, dtype=np.int64)) is None


def test_a_stretch_ends_with_its_segment() -> None:
    """Two runs at one level and the next are four stretches of two levels."""
    rng = np.random.default_rng(4)
    current_A = np.repeat([0.5, 0.2, 0.2, 0.5], 500) + rng.normal(0.0, 0.01, 2000)
    found = levels_of(current_A, np.repeat([0, 1], 1000))
    assert found is not None
    assert found.level_A == pytest.approx([0.2, 0.5], abs=0.002)
    assert np.bincount(found.of_row).tolist() == [1000, 1000]
