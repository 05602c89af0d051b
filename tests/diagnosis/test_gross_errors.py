"""Readings that no wheel can have are found, and nothing that a wheel does is taken for one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.source import gross_errors
from tests.diagnosis.simulated import log_of, simulated


@pytest.mark.parametrize("profile", ["identification", "P1", "P2", "S1", "S2", "S3", "S4"])
@pytest.mark.parametrize("noise_rpm", [0.0, 1.0, 10.0])
def test_nothing_a_wheel_does_is_an_error(profile: str, noise_rpm: float) -> None:
    """Reversals, bursts, coast-downs and break-aways of a wheel, read perfectly or poorly: none is left out."""
    run = simulated(profile=profile, seed=3, noise_rpm=noise_rpm)
    assert not gross_errors(run.measured_speed_rad_s, np.zeros(run.time_s.size, dtype=np.int64)).any()


def test_errors_alone_and_in_pairs_are_found() -> None:
    """One in fifty readings 50 rad/s off, some of them two in a row: all of them are found and nothing else."""
    run = simulated(seed=4)
    speed = run.measured_speed_rad_s.copy()
    wrong = np.zeros(speed.size, dtype=bool)
    wrong[0::100] = True
    wrong[1::500] = True
    wrong[-1] = True
    speed[wrong] += 50.0
    assert np.array_equal(gross_errors(speed, np.zeros(speed.size, dtype=np.int64)), wrong)


def test_a_new_segment_may_begin_anywhere() -> None:
    """A jump of the speed where the segment changes is no error, whatever numbers the segments have."""
    speed = np.concatenate((np.linspace(100.0, 90.0, 50), np.linspace(-80.0, -70.0, 50), np.linspace(5.0, 6.0, 50)))
    segment = np.repeat(np.array([7, 2, 7]), 50)
    assert not gross_errors(speed, segment).any()


def test_a_record_of_nothing_but_jumps_is_left_alone() -> None:
    """Where one reading in five stands out they are the record."""
    speed = np.random.default_rng(1).normal(0.0, 1e-3, 1000)
    speed[::5] += 10.0
    assert not gross_errors(speed, np.zeros(1000, dtype=np.int64)).any()


def test_gaps_and_a_few_readings_are_no_errors() -> None:
    """Missing readings are skipped; fewer than five say nothing."""
    speed = np.full(40, 1.0)
    speed[[1, 4, 20]] = np.nan
    speed[3] = 90.0
    assert np.flatnonzero(gross_errors(speed, np.zeros(40, dtype=np.int64))).tolist() == [3]
    assert not gross_errors(speed[:5], np.zeros(5, dtype=np.int64)).any()


def test_readings_that_no_noise_explains_are_counted_to_the_user() -> None:
    """Six, fourteen sigma off and no gross errors: left out of all fits, and said, with the first one's time."""
    run = simulated(seed=3, samples=2400)
    log = log_of(run)
    speed = log.speed_rad_s.copy()
    speed[[1000, 1001, 1002, 1500, 1501, 2300]] += 1.5
    document = diagnose_log(replace(log, speed_rad_s=speed)).document()
    assert any(text.startswith("6 of 2400 readings are further than 6") for text in document["warnings"])
    assert not any("are further than" in text for text in diagnose_log(log).document()["warnings"])
