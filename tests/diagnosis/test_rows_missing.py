"""Logs that lost rows, or whose readings are held: the loss is said first, and nothing absurd is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.sim.plant_batch import simulate_run
from drivers.sim.plant_effect_text import parse_effects
from drivers.sim.plant_parameters import PlantNoise
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.diagnosis.diagnose import diagnose_log
from rw_ekf.logs.wheel_log import WheelLog
from tests.diagnosis.simulated import log_of, simulated

OFFSET = "offset_torque:torque_rad_s2=0.06"


def thinned(log: WheelLog, seed: int) -> WheelLog:
    """The log without a third of its rows, their commands lost with them."""
    keep = np.random.default_rng(seed).random(len(log)) > 0.35
    return replace(
        log, time_s=log.time_s[keep], speed_rad_s=log.speed_rad_s[keep], current_A=log.current_A[keep],
        command_delay_s=log.command_delay_s[keep], segment=log.segment[keep],
        channels={name: values[keep] for name, values in log.channels.items()}, other={},
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("effects", [[], [OFFSET]])
def test_a_log_that_lost_rows_says_so_and_is_judged_all_the_same(effects: list[str]) -> None:
    """Steps every few seconds, a third of the rows lost: healthy is adequate, an offset is named with its size."""
    document = diagnose_log(thinned(log_of(simulated(effects, seed=31, profile="P2")), 32)).document
    verdict = document["verdict"]
    assert verdict["statement"].startswith("Rows are lost: 6.45 samples a second on a 10 Hz grid"), verdict["statement"]
    assert verdict["effects"] == [text.split(":")[0] for text in effects], verdict["statement"]
    if effects:
        found = next(c for c in document["candidates"] if c["effect"] == "offset_torque")["parameters"]
        assert found["torque_rad_s2"]["value"] == pytest.approx(0.06, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("effects", [[], [OFFSET]])
def test_held_readings_say_so_and_are_judged_all_the_same(effects: list[str]) -> None:
    """A speed refreshed at 30 Hz in rows at 100 Hz: healthy is adequate, an offset is named."""
    whole, drive = sample_profile(make_profile("P2", seed=33), 100.0)
    times, currents = np.array(whole[:9_000]), drive[:9_000]
    run = simulate_run(parse_effects(effects), currents, times, PlantNoise(0.08, 0.0), seed=34)
    first = np.concatenate(([True], np.diff(np.floor(times * 30.0 + 1e-9)) > 0))
    held = run.measured_speed_rad_s[np.maximum.accumulate(np.where(first, np.arange(times.size), 0))]
    verdict = diagnose_log(replace(log_of(run), speed_rad_s=held)).document["verdict"]
    assert verdict["statement"].startswith("Readings are held: 70 %"), verdict["statement"]
    assert verdict["effects"] == [text.split(":")[0] for text in effects], verdict["statement"]
