"""The inner speed loop makes the wheel follow what is asked for, whatever its friction, and does not wind up."""

from __future__ import annotations

import pytest

from rw_ekf.control.compensation.speed_mode import SpeedLoop, SpeedMode
from tests.control.compensation.bare_wheel import COULOMB, GAIN, BareWheel, coulomb


def loop(bandwidth_rad_s: float = 5.0) -> SpeedMode:
    return SpeedMode(GAIN, SpeedLoop(bandwidth_rad_s, 1.0))


def test_the_wheel_takes_the_momentum_that_is_asked_for_across_a_reversal() -> None:
    """Asked for -0.3 rad/s^2 for 60 s from +9 rad/s on, it ends at -9 rad/s: friction it was told nothing of."""
    wheel = BareWheel(coulomb(), speed=9.0, period_s=0.01)
    wheel.run(loop(), lambda t: -0.3, 60.0)
    assert wheel.speed == pytest.approx(-9.0, abs=0.02)


def test_a_step_of_friction_displaces_the_angle_by_the_step_over_the_bandwidth_squared() -> None:
    """2 c / w^2, from the integral's balance: what [CK13]'s table feels of a reversal in speed mode."""
    wheel = BareWheel(lambda t, speed: 1.0 if t < 20.0 else 2.0, speed=50.0, period_s=0.01)
    wheel.run(loop(), lambda t: 0.0, 40.0)
    displaced = sum(50.0 - speed for speed in wheel.speeds[2000:]) * 0.01
    assert displaced == pytest.approx(1.0 / 5.0**2, rel=0.05)


def test_a_guard_that_refuses_does_not_wind_the_integral_up() -> None:
    """Ten seconds at a fifth of the current that is asked for; then the reference is caught up without overshoot."""
    scheme, wheel = loop(), BareWheel(coulomb(), speed=20.0, period_s=0.01)
    wheel.run(scheme, lambda t: 0.0, 5.0)
    for _ in range(1000):  # 0.1 rad/s^2 are asked for; so little comes through that the wheel slows
        scheme.current_A(wheel.tick(), 0.1, wheel.known())
        wheel.current_A = 0.2 * COULOMB / GAIN
        wheel.advance(0.01)
    fell_to = wheel.speed
    wheel.run(scheme, lambda t: 0.0, 30.0)
    assert fell_to < 17.0
    assert wheel.speed == pytest.approx(21.0, abs=0.05)
    assert max(wheel.speeds) < 21.0 + 0.15 * (21.0 - fell_to)


def test_a_new_segment_makes_no_jump() -> None:
    """The reference is the speed that is found; the integral, which holds the friction, stays."""
    scheme, wheel = loop(), BareWheel(coulomb(), speed=20.0, period_s=0.01)
    wheel.run(scheme, lambda t: 0.0, 5.0)
    before = wheel.current_A
    wheel.time_s += 100.0
    assert scheme.current_A(wheel.tick(), 0.0, wheel.known()) == pytest.approx(before, abs=0.2 * COULOMB / GAIN)
