"""Motors that settle within tenths of a second: seconds of them are a record, and runs with pauses are runs."""

from __future__ import annotations

import numpy as np
import pytest

import rw_ekf
from rw_ekf.arrays import Float64Array

GAIN, VISCOUS, COULOMB = 95.0, 8.0, 4.0


def speeds(time_s: Float64Array, drive: Float64Array, late_s: float = 0.0) -> Float64Array:
    """Of a motor at rest at first, by Euler's method at .1 ms; drive (n,): from its row on, and so much later."""
    finer = np.arange(time_s[0], time_s[-1], 1.0e-4)
    index = np.searchsorted(time_s + late_s, finer, side="right") - 1
    given = np.where(index >= 0, drive[np.maximum(index, 0)], 0.0)
    omega, found = 0.0, np.empty(finer.size)
    for i, u in enumerate(given.tolist()):
        found[i] = omega
        push = GAIN * u - VISCOUS * omega
        if omega == 0.0 and abs(push) <= COULOMB:
            continue
        way = np.sign(omega) if omega != 0.0 else np.sign(push)
        further = omega + 1.0e-4 * (push - COULOMB * way)
        omega = further if further * omega >= 0.0 else 0.0
    return np.interp(time_s, finer, found)


@pytest.mark.parametrize("seed", [0, 1])
def test_seconds_of_a_quick_motor_are_judged(seed: int) -> None:
    """Two and a half seconds are twenty times what it settles in; it is sound, and is told so."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(250) / 100.0
    drive = np.repeat(rng.uniform(-1.0, 1.0, 13), 20)[:250]
    speed = speeds(time_s, drive) + 0.05 * rng.standard_normal(250)
    reported = rw_ekf.diagnose(rw_ekf.read({"time_s": time_s, "speed_rad_s": speed, "current_A": drive}))
    assert reported.document()["verdict"]["kind"] == "adequate"


def test_runs_with_pauses_and_stamps_that_jitter_show_a_late_command() -> None:
    """Four runs of a second, half a minute apart, each from rest under one command, which acts 20 ms late.

    Over the pauses a command was taken to go on, which made the gain negative; and as it always had been, no delay
    was to be seen.
    """
    rng = np.random.default_rng(4)
    times, drives, readings = [], [], []
    for number, command in enumerate((1.0, -1.0, 0.6, -0.6)):
        time_s = np.cumsum(rng.uniform(0.004, 0.008, 170))
        drive = np.full(170, command)
        speed = speeds(time_s, drive, late_s=0.02)
        times.append(30.0 * number + time_s)
        drives.append(drive)
        readings.append(np.where(speed == 0.0, 0.0, speed + 0.03 * rng.standard_normal(170)))
    columns = {
        "time_s": np.concatenate(times), "speed_rad_s": np.concatenate(readings), "current_A": np.concatenate(drives)
    }  # fmt: skip
    reported = rw_ekf.diagnose(rw_ekf.read(columns))
    document = reported.document()
    assert document["verdict"]["effects"] == ["transport_delay"]
    found = next(item for item in document["candidates"] if item["effect"] == "transport_delay")["parameters"]
    delay = found["delay_s"] if "delay_s" in found else next(iter(found.values()))
    assert abs(delay["value"] - 0.02) < 4.0 * delay["std"] + 0.002
    assert reported.model is not None
    assert reported.model.parameters.motor_gain == pytest.approx(GAIN, rel=0.05)
