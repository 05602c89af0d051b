"""Logs of seconds, as a fast motor at a high rate gives them: judged, and held out whole where there are several."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

import rw_ekf
from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.prepare.split import split_record
from rw_ekf.units import RAD_S_PER_RPM

RATE_HZ, SECONDS, NOISE_RPM = 100.0, 7.0, 2.0
_STEPS = 50  # of a sample
_LEVELS_A = (0.0, 0.25, 0.45, 0.6, 0.35, 0.15, 0.0)


def turned(current_A: Float64Array, windage_1_rad: float, rate_hz: float = RATE_HZ) -> Float64Array:
    """Speeds (n,) of a small motor from rest, by explicit steps that share nothing with the estimator."""
    k, b, c, s, omega_s = 90.0, 0.15, 3.0, 3.6, 0.42
    omega, found, h = 0.0, np.zeros(current_A.size), 1.0 / rate_hz / _STEPS
    for i in range(current_A.size):
        found[i] = omega
        for _ in range(_STEPS):
            drive = k * current_A[i]
            if omega == 0.0 and abs(drive) <= s:
                continue
            way = math.copysign(1.0, omega if omega != 0.0 else drive)
            dry = c + (s - c) * math.exp(-((omega / omega_s) ** 2))
            following = omega + h * (drive - b * omega - way * dry - windage_1_rad * omega * abs(omega))
            omega = following if omega * following >= 0.0 else 0.0
    return found


def short_log(folder: Path, seed: int, *, held: int = 1, windage_1_rad: float = 0.0) -> rw_ekf.Log:
    """One direction, six levels of current; each reading stands for `held` rows."""
    rng, n = np.random.default_rng(seed), int(SECONDS * RATE_HZ)
    time_s = np.arange(n) / RATE_HZ
    changes = np.sort(rng.uniform(0.5, SECONDS - 0.5, len(_LEVELS_A) - 1))
    current_A = np.array(_LEVELS_A)[np.searchsorted(changes, time_s)]
    readings = turned(current_A, windage_1_rad) + NOISE_RPM * RAD_S_PER_RPM * rng.standard_normal(n)
    readings = readings[np.arange(n) // held * held]
    path, table = folder / f"log{seed}.csv", np.column_stack((time_s, readings, current_A))
    np.savetxt(path, table, delimiter=",", header="time_s,speed_rad_s,current_command_A", comments="")
    return rw_ekf.read(path)


@pytest.mark.parametrize("held", [1, 3])
def test_a_joint_fit_of_short_logs_predicts_one_of_them_to_the_readings_noise(tmp_path: Path, held: int) -> None:
    """Two logs of 7 s, one held out: the other's fit misses it by no more than its noise, held readings or not."""
    logs = [short_log(tmp_path, seed, held=held, windage_1_rad=2.0e-4) for seed in (1, 2)]
    document = rw_ekf.diagnose(logs).document()
    assert document["verdict"]["kind"] == "adequate"
    (heldout,), (fitted,) = document["split"]["heldout_s"], document["split"]["fit_s"]
    assert heldout[1] < fitted[0] or fitted[1] < heldout[0]
    assert min(heldout[1] - heldout[0], fitted[1] - fitted[0]) > SECONDS - 0.05
    assert document["before"]["free_run_rms_rpm"] < 1.1 * NOISE_RPM
    assert 0.8 < document["before"]["nis_mean"] < 1.2


@pytest.mark.parametrize("seed", [1, 2])
def test_one_log_of_seven_seconds_is_judged(tmp_path: Path, seed: int) -> None:
    """Nothing is missing from a healthy one; windage of a quarter of the drive is found in another."""
    assert rw_ekf.diagnose(short_log(tmp_path, seed)).verdict["kind"] == "adequate"
    found = rw_ekf.diagnose(short_log(tmp_path, seed, windage_1_rad=2.0e-3)).verdict
    assert found["effects"] in (["quadratic_drag"], ["cubic_drag"])


@pytest.mark.slow
def test_a_change_in_a_record_of_seconds_is_one_and_is_told_to_hundredths() -> None:
    """A motor whose gain falls by a fifth: when, how much, and not as two changes, or as what ended there."""
    seconds = 8.0
    rng, rows, at_s = np.random.default_rng(5), int(500.0 * seconds), 0.6 * seconds
    time_s = np.arange(rows) / 500.0
    current_A = np.repeat(rng.choice([-0.9, -0.3, 0.3, 0.9], size=rows // 100), 100)
    speed = turned(np.where(time_s < at_s, current_A, 0.8 * current_A), 0.0, 500.0)
    readings = speed + 0.1 * rng.standard_normal(rows)
    reported = rw_ekf.diagnose(rw_ekf.read({"time_s": time_s, "speed_rad_s": readings, "current_A": current_A}))
    assert reported.verdict["effects"] == ["change"], reported.verdict["statement"]
    (begun,) = re.findall(
        r"From ([\d.]+) \+- ([\d.]+) s on the motor gain changes by (-[\d.]+)", reported.verdict["statement"]
    )
    assert float(begun[0]) == pytest.approx(at_s, abs=max(4.0 * float(begun[1]), 0.01))
    assert float(begun[2]) == pytest.approx(-20.0, abs=0.5)


def test_logs_that_go_one_way_each_are_cut() -> None:
    """Held out whole, no part would know both directions."""
    log_of = np.repeat(np.arange(2), 700)
    time_s = np.arange(1400) / RATE_HZ
    speed = np.where(log_of == 0, 50.0, -50.0)
    whole = split_record(time_s, log_of, np.full(1400, 50.0), "blocks", 0.1, log_of)
    assert (whole.heldout == (log_of == 1)).all()
    cut = split_record(time_s, log_of, speed, "blocks", 0.1, log_of)
    for part in (cut.fit, cut.heldout):
        assert (speed[part] > 0.0).any()
        assert (speed[part] < 0.0).any()
