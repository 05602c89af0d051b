"""The sign and the size of the motor gain from readings alone: wrong ones found, healthy wheels never accused."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from rw_ekf.control.profiles.make_profile import make_profile
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.records import IssuedCommand, WheelSample
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.watch.sign_watch import SignWatch
from tests.ticks import tick_of
from tests.watch.test_stuck_watch import STRIBECK, Wheel

PERIOD_S, DELAY_S = 0.1, 0.01
Current = Callable[[float], float]


def profile(name: str, amplitude_A: float, period_s: float) -> Current:
    return make_profile(name, amplitude_A=amplitude_A, period_s=period_s, bias_A=0.0, seed=3).current_A


def run(
    wheel: Wheel,
    current: Current,
    duration_s: float,
    *,
    scale: float = 1.0,
    speed: float = 0.0,
    outside: Callable[[float], float] = lambda t: 0.0,
    every_missing: int = 0,
) -> tuple[SignWatch, float | None]:
    """The watch over a run, and when it was sure of a wrong sign. scale: of the map's speed against the true one."""
    watch = SignWatch(DEFAULT_PRIOR.parameters, STRIBECK, RAD_S_PER_RPM)
    noise = np.random.default_rng(11).normal(0.0, RAD_S_PER_RPM, round(duration_s / PERIOD_S))
    flows, wrong = 0.0, None
    for i in range(round(duration_s / PERIOD_S)):
        t = PERIOD_S * i
        lost = every_missing > 0 and i % every_missing == every_missing - 1
        command = IssuedCommand(round(current(t), 4), DELAY_S)
        reading = WheelSample(t, None if lost else scale * (speed + noise[i]))
        watch.add(tick_of(reading, None if lost else command))
        if wrong is None and watch.is_wrong:
            wrong = t
        speed = wheel.after(speed, flows + outside(t) / wheel.k, DELAY_S)
        flows = flows if lost else command.current_A
        speed = wheel.after(speed, flows + outside(t) / wheel.k, PERIOD_S - DELAY_S)
    return watch, wrong


PROFILES = [
    ("sine", 0.1, 6.0),
    ("sine", 0.3, 40.0),
    ("steps", 0.08, 10.0),
    ("random-sines", 0.2, 30.0),
    ("identification", 0.1, 30.0),
]


@pytest.mark.parametrize("shape", PROFILES)
@pytest.mark.parametrize("k", [13.0, 15.0, 23.0])
@pytest.mark.parametrize("speed", [0.0, -209.0])
def test_a_wrong_sign_is_found(shape: tuple[str, float, float], k: float, speed: float) -> None:
    """A map that turns the sign: found within half a minute of a profile, for any gain and any speed at the start."""
    watch, wrong = run(Wheel(k=k), profile(*shape), 32.0, scale=-1.0, speed=speed)
    assert wrong is not None
    gain, std = watch.gain
    assert gain == pytest.approx(-k, abs=4.0 * std)


@pytest.mark.parametrize("shape", [*PROFILES, ("steps", 0.3, 600.0), ("zero", 0.0, 30.0), ("sine", 0.02, 8.0)])
@pytest.mark.parametrize("k", [7.6, 15.2, 22.8])
@pytest.mark.parametrize("speed", [0.0, 209.0, -209.0])
def test_a_healthy_wheel_is_never_accused(shape: tuple[str, float, float], k: float, speed: float) -> None:
    """The gain drawn +-50 %, friction with it, wheels at rest and turning either way, tiny currents: nothing."""
    wheel = Wheel(k=k, c=0.586 * 15.2 / k, s=0.8 * 15.2 / k)
    watch, wrong = run(wheel, profile(*shape), 60.0, speed=speed, every_missing=7)
    assert wrong is None
    assert watch.odd_factor is None


@pytest.mark.parametrize("period_s", [8.0, 30.0, 100.0])
@pytest.mark.parametrize("amplitude_A", [0.0, 0.005, 0.05])
def test_a_torque_from_outside_is_no_wrong_sign(period_s: float, amplitude_A: float) -> None:
    """A third of Coulomb friction, exactly against the current: the gain looks smaller, never negative."""
    phase = 2.0 * math.pi / period_s
    watch, wrong = run(
        Wheel(),
        lambda t: 0.06 + amplitude_A * math.sin(phase * t),
        200.0,
        speed=50.0,
        outside=lambda t: -0.2 * math.sin(phase * t),
    )
    assert wrong is None
    assert watch.pieces > 100


@pytest.mark.parametrize("scale", [10.0, 0.1, -10.0])
def test_a_scale_that_is_ten_times_off_is_named(scale: float) -> None:
    """The factor that comes out is that of the map, whichever way it is off."""
    watch, wrong = run(Wheel(), profile("steps", 0.3, 8.0), 60.0, scale=scale)
    assert watch.odd_factor == pytest.approx(abs(scale), rel=0.3)
    assert (wrong is not None) is (scale < 0.0)


def test_a_new_segment_and_a_gap_are_no_motion() -> None:
    """The clock jumps and the speed is another: what lies between two segments says nothing of the current."""
    watch = SignWatch(DEFAULT_PRIOR.parameters, STRIBECK, RAD_S_PER_RPM)
    for i in range(200):
        for sample in (
            WheelSample(0.3 * i, 100.0 - 20.0 * i, segment=i),
            WheelSample(100.0 * i + 1000.0, 100.0 - 20.0 * i, segment=300),
        ):
            watch.add(tick_of(sample, IssuedCommand(0.3, DELAY_S)))
    assert watch.pieces == 0


@pytest.mark.parametrize(("share", "amplitude_A", "period_s"), [(0.1, 0.1, 1.0), (0.2, 0.3, 2.0)])
def test_wild_readings_make_no_gain(share: float, amplitude_A: float, period_s: float) -> None:
    """One reading in ten or in five is 500 rpm off: of 24 healthy wheels none is accused, at any time of 30 s."""
    current = profile("steps", amplitude_A, period_s)
    for seed in range(24):
        rng = np.random.default_rng(seed)
        watch, wheel, speed = SignWatch(DEFAULT_PRIOR.parameters, STRIBECK, RAD_S_PER_RPM), Wheel(), 0.0
        for i in range(300):
            wild = rng.choice([-500.0, 500.0]) if rng.random() < share else 0.0
            reading = WheelSample(PERIOD_S * i, speed + RAD_S_PER_RPM * (rng.standard_normal() + wild))
            command = IssuedCommand(round(current(PERIOD_S * i), 4), 0.0)
            watch.add(tick_of(reading, command))
            assert not watch.is_wrong, seed
            assert watch.odd_factor is None, seed
            speed = wheel.after(speed, command.current_A, PERIOD_S)


@pytest.mark.parametrize("every_missing", [2, 3])
def test_time_that_lost_replies_spoil_is_counted(every_missing: int) -> None:
    """Each second or third reply: nearly all of 30 s tells nothing, and that is known; without losses none."""
    watch, _ = run(Wheel(), profile("steps", 0.1, 2.0), 30.0, every_missing=every_missing)
    assert 20.0 < watch.lost_s < 31.0
    assert watch.lost_s > 5.0 * (watch.used_s + watch.quiet_s)
    watch, _ = run(Wheel(), profile("steps", 0.1, 2.0), 30.0)
    assert watch.lost_s == 0.0
    assert watch.used_s + watch.quiet_s == pytest.approx(30.0, abs=1.0)
    held, _ = run(Wheel(k=1e-9), profile("steps", 0.1, 2.0), 30.0, every_missing=50)
    assert held.quiet_s > held.lost_s
