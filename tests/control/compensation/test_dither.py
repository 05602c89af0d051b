"""A dither adds no net momentum, whatever the wave, the rate and the clock; it runs near zero speed only."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from rw_ekf.control.compensation.dither import WAVES, Dither, DitherSignal
from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.pid_current import PidCurrent
from rw_ekf.records import WheelSample
from rw_ekf.units import rad_s_from_rpm
from tests.control.compensation.bare_wheel import BELIEVED, COULOMB, GAIN, STRIBECK, BareWheel, coulomb
from tests.ticks import tick_of


def dither(wave: str = "triangular", rate_hz: float = 10.0, **signal: float) -> Dither:
    return Dither(PidCurrent(GAIN), GAIN, COULOMB, rate_hz, WAVES[wave], DitherSignal(**signal))


def driven(scheme: Dither, times_s: np.ndarray, speed_rpm: Callable[[float], float]) -> np.ndarray:
    """Momentum per inertia after each turn [rad/s], by what is in force between the turns; asked for: nothing."""
    momentum, found, last_s, drive = 0.0, [], float(times_s[0]), 0.0
    for time_s in times_s.tolist():
        momentum += drive * (time_s - last_s)
        last_s = time_s
        known = WheelKnown.of_parameters(rad_s_from_rpm(speed_rpm(time_s)), BELIEVED, STRIBECK)
        drive = GAIN * scheme.current_A(tick_of(WheelSample(time_s, 0.0)), 0.0, known)
        found.append(momentum)
    return np.array(found)


@pytest.mark.parametrize("wave", WAVES)
@pytest.mark.parametrize(("rate_hz", "frequency_hz"), [(10.0, 5.0), (10.0, 2.5), (10.0, 0.7), (50.0, 11.0), (7.0, 3.5)])
def test_the_net_momentum_over_each_period_is_zero(wave: str, rate_hz: float, frequency_hz: float) -> None:
    """Sampled at the loop's rate, while the amplitude follows the speed."""
    scheme = dither(wave, rate_hz, frequency_hz=frequency_hz)
    cycles = round(rate_hz / scheme.frequency_hz)
    times = np.arange(cycles * 40) / rate_hz
    momentum = driven(scheme, times, lambda t: 9.0 * math.cos(0.3 * t))
    assert np.abs(momentum).max() > 0.005
    assert np.abs(momentum[::cycles]).max() < 1e-12


@pytest.mark.parametrize("leaves_s", np.arange(2.0, 4.0, 0.1).tolist())
def test_it_stops_at_the_end_of_a_period_only_however_the_speed_leaves_the_threshold(leaves_s: float) -> None:
    """Wherever within the period the wheel gets fast, what has been added by the time the dither is off is zero."""
    momentum = driven(dither(frequency_hz=0.7), np.arange(80) * 0.1, lambda t: 0.0 if t < leaves_s else 100.0)
    assert np.abs(momentum[:20]).max() > 0.05
    assert np.abs(momentum[-20:]).max() < 1e-12


def test_turns_that_come_late_or_not_at_all_are_made_up_for() -> None:
    """Cycles that jitter by a fifth and one in ten missed: the mean of the momentum stays within a cycle's worth."""
    draw = np.random.default_rng(4)
    times = np.arange(1000) * 0.1 + draw.uniform(-0.02, 0.02, 1000)
    times = times[draw.uniform(size=1000) > 0.1]
    scheme = dither("square", frequency_hz=2.5)
    momentum = driven(scheme, times, lambda t: 0.0 if t < 90.0 else 100.0)
    assert np.abs(momentum).max() < 5.0 * COULOMB * 0.1
    assert np.abs(momentum[-50:]).max() < 1e-3


def test_the_amplitude_falls_with_the_speed_and_is_zero_beyond_the_threshold() -> None:
    """The largest torque of a period at a steady speed, over the break-away friction."""
    for speed_rpm, share in ((0.0, 1.0), (5.0, 0.5), (-7.5, 0.25), (10.0, 0.0), (300.0, 0.0)):
        scheme, most = dither("square", threshold_rpm=10.0, amplitude=1.0), 0.0
        known = WheelKnown.of_parameters(rad_s_from_rpm(speed_rpm), BELIEVED, STRIBECK)
        for i in range(40):
            most = max(most, GAIN * scheme.current_A(tick_of(WheelSample(0.1 * i, 0.0)), 0.0, known))
        assert most == pytest.approx(share * COULOMB, abs=1e-9)


def test_the_waves_are_symmetrical_about_zero() -> None:
    """Each half is the other one negated; triangular and sine as they are drawn, [S91] figure 7."""
    for wave in WAVES.values():
        for phase in np.linspace(0.0, 0.999, 37):
            assert wave(phase + 0.5) == pytest.approx(-wave(phase), abs=1e-12)
    assert [WAVES["triangular"](p) for p in (0.0, 0.125, 0.25, 0.5, 0.75)] == [0.0, 0.5, 1.0, 0.0, -1.0]


def test_a_loop_takes_the_nearest_frequency_that_it_can_make() -> None:
    """Half its rate at most: at 10 Hz 5 Hz, and then 2.5."""
    assert dither(frequency_hz=40.0).frequency_hz == pytest.approx(5.0)
    assert dither(frequency_hz=2.4).frequency_hz == pytest.approx(2.5)
    assert dither(rate_hz=100.0, frequency_hz=24.0).frequency_hz == pytest.approx(25.0)


def test_a_wheel_at_rest_under_half_its_friction_moves_by_dither_and_not_without() -> None:
    """Sufficient energy is available to overcome the friction ([S91]), and in the mean it goes where it is driven."""
    still, shaken = BareWheel(coulomb()), BareWheel(coulomb())
    still.run(PidCurrent(GAIN), lambda t: 0.5 * COULOMB, 20.0)
    shaken.run(dither("square", amplitude=1.0, frequency_hz=1.25), lambda t: 0.5 * COULOMB, 20.0)
    assert still.speed == 0.0
    assert np.mean(shaken.speeds) > 0.03
