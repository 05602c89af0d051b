"""Above the speed limit, what brakes is judged by what the speed did."""

from __future__ import annotations

import pytest

from rw_ekf.clock import VirtualClock
from rw_ekf.live.guard import BrakeCheck, CurrentGuard, SafetyLimits
from rw_ekf.records import WheelSample
from tests.live.test_guard import ScriptedWheel

LIMIT, STEP = 10.0, 0.1


def drive(gain: float, torque: float, current_A: float, speed: float, steps: int) -> list[float]:
    """What is written, tick after tick, on a wheel of its own sign with a torque on it, and its readings."""
    brake, written, flows = BrakeCheck(LIMIT, STEP), [], 0.0
    for _ in range(steps):
        speed += 0.1 * (gain * flows + torque - (0.6 if speed > 0.0 else -0.6))
        flows = current_A if brake.works(speed, current_A) else 0.0
        brake.written(flows)
        written.append(flows)
    return written


@pytest.mark.parametrize("speed", [14.0, -14.0])
def test_a_brake_that_slows_the_wheel_is_let_through(speed: float) -> None:
    """Down to the limit and through it, at full current and at a tenth of it."""
    for current in (0.5, 0.05):
        braking = -current if speed > 0.0 else current
        assert set(drive(15.0, 0.0, braking, speed, 60)) == {braking}


@pytest.mark.parametrize("speed", [14.0, -14.0])
def test_a_brake_that_drives_the_wheel_becomes_zero(speed: float) -> None:
    """With the sign turned, the second write of it at most is the last, as long as the wheel is above the limit."""
    braking = -0.5 if speed > 0.0 else 0.5
    written = drive(-15.0, 0.0, braking, speed, 5)
    assert written.count(braking) <= 2
    assert written[-1] == 0.0


def test_a_torque_stronger_than_the_brake_gets_no_current_against_it() -> None:
    """Something else drives the wheel up: zero, and again the brake once it has come below the limit."""
    written = drive(15.0, 12.0, -0.5, 14.0, 20)
    assert written[-1] == 0.0
    assert drive(15.0, 0.0, -0.5, 9.0, 3) == [-0.5] * 3


def test_the_guard_writes_zero_and_says_why() -> None:
    """Through the guard: the reason is brake_accelerates, and below the limit the request passes again."""
    wheel, clock = ScriptedWheel(), VirtualClock()
    guard = CurrentGuard(wheel, SafetyLimits(0.6, 50.0, LIMIT, 60.0, 0.5), clock, STEP)

    def write(speed: float) -> tuple[float, str | None]:
        clock.sleep(0.1)
        issued = guard.write(-0.5, WheelSample(1.0, speed))
        return issued.current_A, issued.reason

    assert write(11.0) == (-0.5, None)
    assert write(11.3) == (-0.5, None)  # within the noise
    assert write(12.0) == (0.0, "brake_accelerates")
    assert write(11.5) == (0.0, "brake_accelerates")
    assert write(9.5) == (-0.5, None)


def test_what_holds_the_wheel_is_zero_whatever_is_asked_for() -> None:
    """A reason to hold zero beats every request, and is reported."""
    wheel, clock = ScriptedWheel(), VirtualClock()
    guard = CurrentGuard(wheel, SafetyLimits(0.6, 50.0, LIMIT, 60.0, 0.5), clock, STEP)
    clock.sleep(1.0)
    issued = guard.write(0.4, WheelSample(1.0, 1.0), "telemetry_stuck")
    assert (issued.current_A, issued.reason) == (0.0, "telemetry_stuck")
    assert wheel.sent == [0.0]
