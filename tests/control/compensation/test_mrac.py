"""The adaptation's Lyapunov function falls; what is learned turns its sign with the wheel."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.mrac import Mrac, MracParameters
from rw_ekf.records import WheelSample
from tests.control.compensation.bare_wheel import BELIEVED, COULOMB, STRIBECK, BareWheel, coulomb
from tests.ticks import tick_of

SHEET = BELIEVED._replace(viscous=0.004)
WHEEL_FRICTION = coulomb(viscous=SHEET.viscous)
SLOW = MracParameters(bandwidth_rad_s=0.22, damping=0.9)


def at_speed(speed_rad_s: float) -> WheelKnown:
    """What a filter says of a wheel at a speed [rad/s]."""
    return WheelKnown.of_parameters(speed_rad_s, SHEET, STRIBECK)


def test_the_lyapunov_function_falls_through_reversals() -> None:
    """V = e^2/2 + (c - C)^2/(2 gamma), e from the wheel's true motion: it never rises by more than sampling allows."""
    scheme, values = Mrac(SHEET, SLOW), []

    class Watched:
        """The scheme, with V noted after each reading."""

        def current_A(self, tick, request, known):  # type: ignore[no-untyped-def]
            current = scheme.current_A(tick, request, known)
            error = scheme.error_rad_s
            values.append(0.5 * error**2 + 0.5 * (COULOMB - scheme.coulomb_rad_s2) ** 2 / SLOW.integral_1_s2)
            return current

    wheel = BareWheel(WHEEL_FRICTION, speed=0.8, period_s=0.01)
    wheel.run(Watched(), lambda t: 0.5 * np.sin(0.3 * t), 120.0)
    found = np.array(values[1:])
    assert found[-1] < 1e-3 * found[0]
    assert np.diff(found).max() < 2e-3 * found[0]


def test_after_learning_in_one_direction_the_other_is_compensated_at_once() -> None:
    """The first reversal ever: the wheel goes on as the reference model does, to within what sampling costs."""
    request = -0.3
    wheel = BareWheel(WHEEL_FRICTION, speed=10.0)
    wheel.run(Mrac(SHEET, SLOW), lambda t: request if t > 60.0 else 0.0, 130.0)
    speed = np.array(wheel.speeds)[620:]
    assert speed[0] > 0.0 > speed[-1]
    wanted = speed[0] + request * 0.1 * np.arange(speed.size)
    assert np.abs(speed - wanted).max() < 0.05


def test_the_learned_friction_is_limited() -> None:
    """A wheel that does not turn at all is not pushed without end."""
    scheme = Mrac(SHEET, MracParameters())
    for i in range(5000):
        scheme.current_A(tick_of(WheelSample(0.1 * i, 0.0, current_command_A=0.0)), 1.0, at_speed(0.0))
    assert scheme.coulomb_rad_s2 <= 6.0 * SHEET.static


def test_readings_are_used_where_they_are_asked_for() -> None:
    """A reading on the other side of zero turns the sign of what was learned, but not the filter's sign."""
    currents = []
    given: list[dict[str, Any]] = [{}, {"speed": "raw", "sign": "raw"}, {"speed": "raw"}]
    for sources in given:
        scheme = Mrac(SHEET, MracParameters(**sources))
        scheme.coulomb_rad_s2 = COULOMB
        currents.append(scheme.current_A(tick_of(WheelSample(0.0, -0.1)), 0.0, at_speed(0.1)))
    viscous, k = 0.1 * SHEET.viscous, SHEET.motor_gain
    assert currents == pytest.approx(
        [(COULOMB + viscous) / k, -(COULOMB + viscous) / k, (COULOMB - viscous) / k], rel=1e-12
    )
