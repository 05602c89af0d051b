"""The alarm "residual is not noise": raised for what the model lacks, under the right name, and ended."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.watch.alarms import RESIDUAL
from rw_ekf.watch.residual_watch import NOISE_LEVEL
from tools.measure.watch_runs import Heard, commands, drawn_wheel, heard, simulated

CHANGE_S = 900.0


def residual(heard_all: list[Heard]) -> list[Heard]:
    return [found for found in heard_all if found.alarm.name == RESIDUAL]


def named(effect: str, profile: str, seed: int, from_s: float, hours: float = 0.6) -> list[tuple[float, str]]:
    """(time, name) each time the alarm is raised or renamed."""
    time_s, current_A = commands(profile, hours, seed)
    run = simulated(drawn_wheel(seed + 10, 0.3), time_s, current_A, seed, effect=effect, from_s=from_s)
    begun = [found for found in residual(heard(run)) if found.alarm.ended_s is None]
    return [(found.time_s, str(found.alarm.details["largest_dependence"])) for found in begun]


@pytest.mark.parametrize(
    ("effect", "profile", "name", "within_s"),
    [
        ("offset_torque:torque_rad_s2=0.02", "identification", "direction", 120.0),
        ("offset_torque:torque_rad_s2=0.02", "sine", "direction", 120.0),
        ("viscous_asymmetry:difference_1_s=0.0002", "identification", "speed", 200.0),
        ("quadratic_drag:coefficient_1_rad=0.000001", "identification", "speed", 300.0),
        ("motor_saturation:slope_1_A=0.05", "P2", "current", 300.0),
        ("transport_delay:delay_s=0.05", "P1", "change of current", 500.0),
        ("coulomb_temperature:slope_1_K=-0.01", "identification", "temperature", 300.0),
        ("coulomb_temperature:slope_1_K=-0.01", "random-sines", "temperature", 400.0),
    ],
)
def test_what_sets_in_is_named(effect: str, profile: str, name: str, within_s: float) -> None:
    """An effect that sets in after 15 min raises the alarm in time, and the last name given within 20 min is right."""
    for seed in range(3):
        stated = named(effect, profile, seed, CHANGE_S)
        assert stated, (effect, seed)
        assert CHANGE_S < stated[0][0] < CHANGE_S + within_s
        assert stated[-1][1] == name, (seed, stated)


@pytest.mark.parametrize(
    ("effect", "name"),
    [
        ("offset_torque:torque_rad_s2=0.01", "direction"),
        ("actuator_lag:time_constant_s=0.05", "change of current"),
        ("coulomb_temperature:slope_1_K=-0.01", "temperature"),
    ],
)
def test_what_the_wheel_always_had_is_named_too(effect: str, name: str) -> None:
    """An effect from the first sample on, which the estimator has partly absorbed, is still seen and named."""
    for seed in range(2):
        stated = named(effect, "identification", seed, 0.0)
        assert stated, seed
        assert stated[-1][1] == name, (seed, stated)


def test_the_alarm_says_since_when() -> None:
    """The time given is that of the change, within a minute before and half a minute after."""
    for seed in range(3):
        time_s, current_A = commands("sine", 0.35, seed)
        effect = "offset_torque:torque_rad_s2=0.02"
        run = simulated(drawn_wheel(seed + 10, 0.3), time_s, current_A, seed, effect=effect, from_s=CHANGE_S)
        (first, *_) = residual(heard(run))
        assert CHANGE_S - 60.0 < first.alarm.since_s < CHANGE_S + 30.0


def test_the_alarm_ends_when_the_cause_is_gone() -> None:
    """A torque that is there for 200 s only: the alarm ends once the estimator has unlearnt it."""
    time_s, current_A = commands("P2", 0.7, 3)
    wheel = drawn_wheel(13, 0.3)
    with_torque = simulated(wheel, time_s, current_A, 3, effect="offset_torque:torque_rad_s2=0.03", from_s=CHANGE_S)
    cut = round(10.0 * (CHANGE_S + 200.0))
    after = simulated(wheel, time_s, current_A, 3)
    # The wheel reverses under this command, so that its speed soon forgets what was: join the two runs.
    for name in ("measured_speed_rad_s", "speed_rad_s"):
        getattr(with_torque, name)[cut:] = getattr(after, name)[cut:]
    stated = residual(heard(with_torque))
    assert stated
    assert stated[0].alarm.ended_s is None
    assert stated[-1].alarm.event == "residual_noise_again"
    assert stated[-1].time_s > CHANGE_S + 200.0


def test_a_noise_that_is_not_the_configured_one_is_called_that() -> None:
    """Twice the configured noise is not structure: the alarm names the noise level, not a dependence."""
    time_s, current_A = commands("P2", 0.3, 1)
    run = simulated(drawn_wheel(11, 0.3), time_s, current_A, 1, noise_rpm=1.5)
    stated = residual(heard(run, 1.0))
    assert stated
    assert {str(h.alarm.details["largest_dependence"]) for h in stated} == {NOISE_LEVEL}
    ratio = stated[-1].alarm.details["noise_ratio"]
    assert isinstance(ratio, float)
    assert 1.3 < ratio < 1.6


def test_a_log_without_temperature_never_names_it() -> None:
    """Where temperature is not measured the alarm falls on what is."""
    time_s, current_A = commands("identification", 0.5, 2)
    effect = "coulomb_temperature:slope_1_K=-0.01"
    run = simulated(drawn_wheel(12, 0.3), time_s, current_A, 2, effect=effect)
    run.temperature_degC[:] = np.nan
    names = {str(h.alarm.details["largest_dependence"]) for h in residual(heard(run))}
    assert names
    assert "temperature" not in names
