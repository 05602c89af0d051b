"""Whether the current that flows is the one commanded, and the speed by the charge that was written."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.records import IssuedCommand, WheelSample
from rw_ekf.watch.charge_speed import ChargeSpeed
from rw_ekf.watch.current_watch import CurrentWatch
from rw_ekf.watch.stuck_watch import ParameterBelief

LIMIT_A = 0.3


def event_of(reported, measured, turns: int = 120) -> str | None:  # type: ignore[no-untyped-def]
    """The event after a sine of commands, each read back and measured as the two functions say."""
    watch = CurrentWatch(LIMIT_A)
    command = 0.0
    for i in range(turns):
        watch.add(WheelSample(0.1 * i, 10.0, current_A=measured(command, i), current_command_A=reported(command, i)))
        command = 0.2 * math.sin(0.02 * i)
        watch.commanded(IssuedCommand(command))
    return None if watch.fault is None else watch.fault[0]


def honest(command: float, i: int) -> float:
    return command


def test_an_amplifier_with_noise_and_a_lag_is_as_commanded() -> None:
    """20 mA of noise, 5 % of gain, half a second of lag: no event."""
    rng = random.Random(3)
    assert event_of(honest, lambda a, i: 1.05 * a + rng.gauss(0.0, 0.02)) is None
    assert event_of(honest, lambda a, i: 0.2 * math.sin(0.02 * max(i - 6, 0))) is None


@pytest.mark.parametrize("measured", [lambda a: 0.0, lambda a: min(max(a, -0.1), 0.1), lambda a: 0.15 * a])
def test_an_amplifier_that_is_off_clips_or_is_weak_is_found(measured) -> None:  # type: ignore[no-untyped-def]
    """Off, clipped at 0.1 A, at 15 %: said."""
    assert event_of(honest, lambda a, i: measured(a)) == "current_not_as_commanded"


def test_another_master_is_found_and_one_wild_read_back_is_not() -> None:
    """0.25 A read back for good; one number in ten wild."""
    assert event_of(lambda a, i: 0.25, lambda a, i: a) == "command_not_in_force"
    assert event_of(lambda a, i: 3.0 if i % 10 == 0 else a, lambda a, i: a) is None


def belief(share: float = 0.03) -> ParameterBelief:
    """What an estimator has learned to a share of each parameter."""
    parameters = DEFAULT_PRIOR.parameters
    return ParameterBelief(parameters, np.diag((share * np.array(parameters)) ** 2))


@pytest.mark.parametrize("reading", [lambda true: 0.5 * true, lambda true: 3.0, lambda true: true - 20.0])
def test_the_charge_keeps_the_true_speed_when_the_reading_leaves_it(reading) -> None:  # type: ignore[no-untyped-def]
    """Half the scale, a dead line, a shift, for 10 s under 0.2 A: the true speed is known to a tenth."""
    k, b, c, _ = DEFAULT_PRIOR.parameters
    charge, true = ChargeSpeed(DEFAULT_PRIOR.parameters), 20.0
    charge.show_gain(k)
    charge.anchor(true)
    for _ in range(100):
        true += 0.1 * (k * 0.2 - b * true - c)
        charge.step(0.1, 0.2, reading(true), belief())
    assert charge.speed_rad_s == pytest.approx(true, rel=0.1)


def test_the_charge_follows_readings_as_far_as_the_wheel_may_be_another() -> None:
    """A wheel with 3 % less gain and 10 % more friction: the two speeds stay together for ten minutes."""
    k, b, c, _ = DEFAULT_PRIOR.parameters
    charge, true = ChargeSpeed(DEFAULT_PRIOR.parameters), 0.0
    charge.anchor(true)
    for i in range(6000):
        current = 0.15 * math.sin(0.01 * i)
        drive = 0.97 * k * current
        if true == 0.0 and abs(drive) <= 1.1 * c:
            step = 0.0
        else:
            step = 0.1 * (drive - math.copysign(1.1 * c, true or drive) - b * true)
        true = 0.0 if true * (true + step) < 0.0 else true + step
        charge.step(0.1, current, true, belief())
        assert charge.speed_rad_s == pytest.approx(true, abs=1.0)
