"""A zero of a wheel that tells no current: by how it slows down, or by idle mode besides, or not confirmed."""

from __future__ import annotations

import math

import pytest

from rw_ekf.clock import VirtualClock
from rw_ekf.live.guard import CurrentGuard, SafetyLimits
from rw_ekf.records import IssuedCommand, LinkCounters, WheelIdentity, WheelSample

LIMITS = SafetyLimits(0.3, 5.0, 400.0, 60.0, 0.5)
STEP = 0.105  # 1 rpm
GAIN, COULOMB = 15.205, 0.58  # rad/s^2/A and rad/s^2, as [CK13] has them


class Coasting:
    """A driver of a wheel that turns, acknowledges everything, and tells its speed alone."""

    def __init__(self, clock: VirtualClock, left_A: float, *, idles: bool | None, speed_rad_s: float = 60.0) -> None:
        """left_A: what zero leaves on. idles: whether idle mode lets go of it; None: there is no such register."""
        self.source, self.link = "coasting", LinkCounters()
        self.identity: WheelIdentity | None = None
        self._clock, self._at_s = clock, clock.monotonic()
        self.left_A, self._idles, self._speed = left_A, idles, speed_rad_s
        self._noise = 0
        self.ways: list[str | None] = []

    def read(self, timeout_s: float) -> WheelSample | None:
        now, self._noise = self._clock.monotonic(), self._noise + 1
        a = GAIN * self.left_A - math.copysign(COULOMB, self._speed)
        self._speed, self._at_s = self._speed + a * (now - self._at_s), now
        return WheelSample(now, self._speed + STEP * math.sin(2.4 * self._noise))

    def command_current(self, current_A: float) -> IssuedCommand:
        return IssuedCommand(current_A)

    def stop_current(self, by: str | None = None) -> IssuedCommand:
        self.read(0.0)
        self.ways.append(by)
        if by is not None and self._idles is None:
            return IssuedCommand(0.0, acknowledged=False, reason=by)
        if by is not None and self._idles:
            self.left_A = 0.0
        return IssuedCommand(0.0, reason=by)

    def close(self) -> None:
        """Nothing to release."""


def stood_down(wheel: Coasting, clock: VirtualClock, share: float | None) -> tuple[bool, list[str]]:
    """What standing down came to, and what was said; share: sigma of the friction over it, None where not known."""
    stated: list[str] = []
    guard = CurrentGuard(wheel, LIMITS, clock, STEP, lambda event, text: stated.append(f"{event}: {text}"))
    if share is not None:
        guard.slowing = lambda speed_rad_s: (COULOMB, share * COULOMB)
    return guard.stand_down(), stated


@pytest.mark.parametrize("left_A", [0.7 * COULOMB / GAIN, 1.5 * COULOMB / GAIN, -0.7 * COULOMB / GAIN])
def test_a_wheel_that_does_not_slow_down_as_its_friction_has_it_is_let_go_of(left_A: float) -> None:
    """A zero leaves .7 or 1.5 of the friction on, or brakes by it: idle mode lets go, seen in the motion."""
    clock = VirtualClock()
    wheel = Coasting(clock, left_A, idles=True)
    confirmed, stated = stood_down(wheel, clock, 0.1)
    assert confirmed
    assert wheel.left_A == 0.0
    assert wheel.ways == [None, "zero_by_mode_idle"]
    assert {text.partition(":")[0] for text in stated} <= {"zero_not_in_force"}


def test_a_current_that_nothing_lets_go_of_is_not_confirmed() -> None:
    """Idle mode and reset are acknowledged and leave .7 of the friction on: it slows down, and is not at zero."""
    clock = VirtualClock()
    wheel = Coasting(clock, 0.7 * COULOMB / GAIN, idles=False)
    confirmed, stated = stood_down(wheel, clock, 0.1)
    assert not confirmed
    assert "where its friction alone slows it by 0.58 +- 0.06" in stated[0]


def test_a_healthy_wheel_of_known_friction_is_at_zero_by_its_motion_alone() -> None:
    """It has no idle mode, and slows down as its friction has it."""
    clock = VirtualClock()
    wheel = Coasting(clock, 0.0, idles=None)
    assert stood_down(wheel, clock, 0.1) == (True, [])


@pytest.mark.parametrize("share", [None, 0.5])
def test_where_friction_is_not_known_idle_mode_is_acknowledged_too(share: float | None) -> None:
    """Not at all, or to a half: no motion tells a small current from none, so it is let go of by two registers."""
    clock = VirtualClock()
    wheel = Coasting(clock, 0.7 * COULOMB / GAIN, idles=True)
    assert stood_down(wheel, clock, share) == (True, [])
    assert wheel.ways == [None, "zero_by_mode_idle"]
    assert wheel.left_A == 0.0


def test_where_nothing_can_tell_it_zero_is_not_confirmed_and_said_why() -> None:
    """Friction is not known and there is no idle mode; at rest the same wheel is at zero."""
    clock = VirtualClock()
    confirmed, stated = stood_down(Coasting(clock, 0.0, idles=None), clock, None)
    assert not confirmed
    assert [text.partition(":")[0] for text in stated] == ["zero_not_told"]
    resting = Coasting(clock, 0.0, idles=None, speed_rad_s=0.0)
    assert stood_down(resting, clock, None)[0]
