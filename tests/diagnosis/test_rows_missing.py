"""Logs that lost rows, or whose readings are held: the loss is said first, and nothing absurd is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.arrays import BoolArray
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_parameters import PlantNoise
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.units import RAD_S_PER_RPM
from tests.diagnosis.simulated import log_of, simulated

OFFSET = "offset_torque:torque_rad_s2=0.06"


def thinned(log: WheelLog, seed: int) -> WheelLog:
    """The log without a third of its rows, their commands lost with them."""
    return of_rows(log, np.random.default_rng(seed).random(len(log)) > 0.35)


def of_rows(log: WheelLog, keep: BoolArray) -> WheelLog:
    """The log of the rows that are kept (n,)."""
    return replace(
        log, time_s=log.time_s[keep], speed_rad_s=log.speed_rad_s[keep], current_A=log.current_A[keep],
        command_delay_s=log.command_delay_s[keep], segment=log.segment[keep],
        channels={name: values[keep] for name, values in log.channels.items()}, other={},
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("effects", [[], [OFFSET]])
def test_a_log_that_lost_rows_says_so_and_is_judged_all_the_same(effects: list[str]) -> None:
    """Steps every few seconds, a third of the rows lost: healthy is adequate, an offset is named with its size."""
    document = diagnose_log(thinned(log_of(simulated(effects, seed=31, profile="P2")), 32)).document()
    verdict = document["verdict"]
    assert verdict["statement"].startswith("Rows are lost: 6.45 samples a second on a 10 Hz grid"), verdict["statement"]
    assert verdict["effects"] == [text.split(":")[0] for text in effects], verdict["statement"]
    if effects:
        found = next(c for c in document["candidates"] if c["effect"] == "offset_torque")["parameters"]
        assert found["torque_rad_s2"]["value"] == pytest.approx(0.06, rel=0.15)


def test_rows_lost_where_the_command_changes_accuse_no_healthy_wheel() -> None:
    """A third of the steps of current are in rows that are lost, six rows of a thousand: what they moved stays."""
    draws, samples = np.random.default_rng(0), 4000
    current_A, at, speed_rad_s = np.zeros(samples), 0, 0.0
    while at < samples:
        length, drive_A = int(draws.uniform(20, 90)), draws.uniform(0.06, 0.12) * draws.choice([-1.0, 1.0])
        if abs(speed_rad_s) > 60.0:
            drive_A = -abs(drive_A) * np.sign(speed_rad_s)
        current_A[at : at + length] = drive_A
        speed_rad_s += (15.2 * drive_A - 0.6 * np.sign(drive_A)) * 0.1 * length
        at += length
    run = simulate_run(parse_effects([]), current_A, np.arange(samples) / 10.0, PlantNoise(RAD_S_PER_RPM, 0.0), seed=0)
    steps = np.flatnonzero(np.diff(current_A)) + 1
    keep = np.ones(samples, dtype=bool)
    keep[draws.choice(steps, steps.size // 3, replace=False)] = False
    verdict = diagnose_log(of_rows(log_of(run), keep)).document()["verdict"]
    assert verdict["kind"] == "adequate", verdict["statement"]


@pytest.mark.slow
@pytest.mark.parametrize("effects", [[], [OFFSET]])
def test_held_readings_say_so_and_are_judged_all_the_same(effects: list[str]) -> None:
    """A speed refreshed at 30 Hz in rows at 100 Hz: healthy is adequate, an offset is named."""
    whole, drive = sample_profile(make_profile("P2", seed=33), 100.0)
    times, currents = np.array(whole[:9_000]), drive[:9_000]
    run = simulate_run(parse_effects(effects), currents, times, PlantNoise(0.08, 0.0), seed=34)
    first = np.concatenate(([True], np.diff(np.floor(times * 30.0 + 1e-9)) > 0))
    held = run.measured_speed_rad_s[np.maximum.accumulate(np.where(first, np.arange(times.size), 0))]
    verdict = diagnose_log(replace(log_of(run), speed_rad_s=held)).document()["verdict"]
    assert verdict["statement"].startswith("Readings are held: 70 %"), verdict["statement"]
    assert verdict["effects"] == [text.split(":")[0] for text in effects], verdict["statement"]
