"""Pistiner's offset is twice the Coulomb friction, applied once a reversal, and taken back where there was none."""

from __future__ import annotations

import math

import pytest

from rw_ekf.control.compensation.pistiner import OffsetSpeeds, PistinerOffset
from rw_ekf.units import rad_s_from_rpm
from tests.control.compensation.bare_wheel import COULOMB, GAIN, BareWheel, coulomb

DISTURBANCE = -0.3  # the wheel's acceleration that holds the attitude [rad/s^2]


def offset(known_rad_s2: float | None = DISTURBANCE, **speeds: float) -> PistinerOffset:
    return PistinerOffset(GAIN, 0.0, OffsetSpeeds(**speeds), known_rad_s2)


class IntegratingController:
    """Holds the wheel to a steady acceleration: what an attitude controller's integral comes to before a reversal."""

    def __init__(self) -> None:
        self.asks = DISTURBANCE + COULOMB

    def __call__(self, time_s: float) -> float:
        return self.asks


@pytest.mark.parametrize("noted_rpm", [5.0, 7.5, 10.0])
@pytest.mark.parametrize("known", [DISTURBANCE, None])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_offset_is_twice_the_coulomb_friction(noted_rpm: float, known: float | None, side: float) -> None:
    """With the disturbance known, or measured from the speed; and the wheel goes on as if it had none."""
    scheme = offset(None if known is None else side * known, noted_rpm=noted_rpm, applied_rpm=0.5)
    wheel = BareWheel(coulomb(), speed=side * 6.0)
    wheel.run(scheme, lambda t: side * (DISTURBANCE + COULOMB), 50.0)
    assert scheme.offset_rad_s2 == pytest.approx(-2.0 * side * COULOMB, rel=1e-2)
    assert wheel.speed == pytest.approx(side * (6.0 + 50.0 * DISTURBANCE), abs=0.2)


def test_viscous_friction_is_no_part_of_it() -> None:
    """Half of what is held at 10 rpm is viscous; the offset is twice the other half."""
    level = rad_s_from_rpm(10.0) * 0.4
    scheme = PistinerOffset(GAIN, 0.4, OffsetSpeeds(10.0, 0.5), DISTURBANCE)
    wheel = BareWheel(coulomb(level, 0.4), speed=6.0)
    wheel.run(
        scheme, lambda t: DISTURBANCE + level + 0.4 * wheel.speed if wheel.speed > 0 else DISTURBANCE + level, 30.0
    )
    assert scheme.offset_rad_s2 == pytest.approx(-2.0 * level, rel=0.02)


def test_nothing_is_applied_before_the_speed_for_it_and_nothing_twice() -> None:
    """The offset is zero down to the speed named, then one value for good."""
    scheme, wheel = offset(applied_rpm=2.0), BareWheel(coulomb(), speed=6.0)
    seen: list[tuple[float, float]] = []
    for _ in range(500):
        before = wheel.speed
        wheel.run(scheme, IntegratingController(), 0.1)
        seen.append((before, scheme.offset_rad_s2))
    assert all(value == 0.0 for speed, value in seen if speed > rad_s_from_rpm(2.0))
    assert len({value for _, value in seen}) == 2


def test_the_way_back_takes_the_offset_back() -> None:
    """Over the other side and home again: what the controller has to hold is then what it was before."""
    scheme, wheel = offset(None), BareWheel(coulomb(), speed=6.0)
    wheel.run(scheme, lambda t: DISTURBANCE + COULOMB, 50.0)
    wheel.run(scheme, lambda t: -DISTURBANCE + COULOMB, 70.0)
    assert wheel.speed > 5.0
    assert scheme.offset_rad_s2 == pytest.approx(0.0, abs=0.02 * COULOMB)


def test_a_wheel_that_turns_back_before_it_is_through_takes_no_offset_with_it() -> None:
    """Noted, applied, and turned around: the friction never changed its sign."""
    scheme, wheel = offset(applied_rpm=5.0), BareWheel(coulomb(), speed=3.0)
    while scheme.offset_rad_s2 == 0.0:
        wheel.run(scheme, IntegratingController(), 0.1)
    assert wheel.speed > 0.0
    for _ in range(300):  # away from zero, whatever the scheme says
        wheel.current_A = (1.0 + COULOMB) / GAIN
        scheme.current_A(wheel.tick(), 0.0, wheel.known())
        wheel.advance(0.1)
    assert scheme.offset_rad_s2 == 0.0


def test_a_new_segment_keeps_the_offset_and_forgets_the_side() -> None:
    """No jump of the current; the next reversal is noted afresh."""
    scheme, wheel = offset(), BareWheel(coulomb(), speed=6.0)
    wheel.run(scheme, IntegratingController(), 50.0)
    before = wheel.current_A
    wheel.time_s += 100.0
    assert scheme.current_A(wheel.tick(), IntegratingController()(0.0), wheel.known()) == pytest.approx(before)
    assert math.isclose(scheme.offset_rad_s2, -2.0 * COULOMB, rel_tol=1e-2)
