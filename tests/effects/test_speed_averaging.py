"""Readings that are means over a window: as the simulated sensor has them, and told from a delay where data can."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.course.course import Course
from rw_ekf.course.free_run import free_run
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.drivers.sim.plant_batch import PlantRun, simulate_run
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_parameters import PlantNoise
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.effect import Term
from rw_ekf.model.friction import Stribeck
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.effect_table import EffectSet

QUIET = PlantNoise(0.0)


def read(text: str, rate_hz: float, seconds: float, noise: PlantNoise = QUIET, profile: str = "P2") -> PlantRun:
    """A profile's beginning, read of the standard wheel with one effect."""
    times, currents = (np.array(column) for column in sample_profile(make_profile(profile, seed=3), rate_hz))
    count = round(rate_hz * seconds)
    return simulate_run(parse_effects([text]), currents[:count], times[:count], noise, seed=5, command_delay_s=0.004)


def followed(run: PlantRun, effect_id: str, value: float) -> Float64Array:
    """Readings that the model predicts from the first one on."""
    effects = EffectSet((Term.of(CATALOGUE[effect_id], value=value),))
    n = run.time_s.size
    delay = np.full(n, run.command_delay_s)
    course = Course.of(run.time_s, run.measured_speed_rad_s, run.current_command_A, delay, None, None, None)
    start = np.array([[run.measured_speed_rad_s[0], *CK13_STATISTICAL, value]])
    stribeck = Stribeck(4.0 * RAD_S_PER_RPM, 0)
    return free_run(course, effects, stribeck, start, np.array([0]), np.array([n - 1]), keep_path=True).path_rad_s


@pytest.mark.parametrize(("rate_hz", "window_s"), [(10.0, 0.05), (10.0, 0.25), (100.0, 0.1)])
def test_the_model_reads_what_the_simulated_sensor_reads(rate_hz: float, window_s: float) -> None:
    """Within what the kink of dry friction at a reversal makes, c W/4, over 60 s; the plant's angle shares no code."""
    run = read(f"speed_averaging:window_s={window_s}", rate_hz, 60.0, profile="identification")
    error = followed(run, "speed_averaging", window_s) - run.measured_speed_rad_s
    assert np.max(np.abs(error)) < 0.3 * CK13_STATISTICAL.coulomb * window_s
    assert np.sqrt(np.mean(error**2)) < 0.03 * CK13_STATISTICAL.coulomb * window_s


def test_half_a_window_of_delay_is_the_same_at_ten_hertz_and_not_at_a_hundred() -> None:
    """Where no current changes within a window the two models are one; elsewhere a corner is rounded by D W/8."""
    slow = read("speed_averaging:window_s=0.05", 10.0, 60.0)
    assert followed(slow, "speed_averaging", 0.05) == pytest.approx(followed(slow, "transport_delay", 0.025), abs=1e-9)
    fast = read("speed_averaging:window_s=0.1", 100.0, 60.0, profile="identification")
    apart = followed(fast, "speed_averaging", 0.1) - followed(fast, "transport_delay", 0.05)
    step = 15.205 * np.max(np.abs(np.diff(fast.current_command_A)))
    assert np.max(np.abs(apart)) > 0.5 * step * 0.1 / 8.0  # steps that follow on each other add up


def log_of(run: PlantRun) -> WheelLog:
    """What a diagnosis reads."""
    n = run.time_s.size
    return WheelLog(
        name="averaged.csv",
        time_s=run.time_s,
        speed_rad_s=run.measured_speed_rad_s,
        current_A=run.current_command_A,
        drive="current_command_A",
        command_delay_s=np.full(n, run.command_delay_s),
        segment=np.zeros(n, dtype=np.int64),
        channels={"current_command_A": run.current_command_A},
        rows_read=n,
    )


@pytest.mark.slow
def test_it_is_told_from_a_delay_at_a_hundred_hertz_and_named_with_it_at_ten() -> None:
    """At 100 Hz and .3 rpm the window alone, to a tenth; at 10 Hz a group that holds it, of a delay of half of it."""
    noise, quiet = PlantNoise(RAD_S_PER_RPM), PlantNoise(0.3 * RAD_S_PER_RPM)
    fast = diagnose_log(log_of(read("speed_averaging:window_s=0.1", 100.0, 160.0, quiet, "identification"))).document()
    assert fast["verdict"]["effects"] == ["speed_averaging"]
    assert fast["verdict"]["indistinguishable"] == []
    entry = next(item for item in fast["candidates"] if item["effect"] == "speed_averaging")
    assert entry["parameters"]["window_s"]["value"] == pytest.approx(0.1, rel=0.1)
    slow = diagnose_log(log_of(read("speed_averaging:window_s=0.05", 10.0, 600.0, noise, "identification"))).document()
    (group,) = slow["verdict"]["indistinguishable"]
    assert {"speed_averaging", "transport_delay"} <= set(group)
