"""The guard: what it writes, what it says was written, and that zero gets through."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from rw_ekf.clock import VirtualClock
from rw_ekf.driver import WheelDriver
from rw_ekf.errors import DriverError
from rw_ekf.live.guard import CurrentGuard, SafetyLimits
from rw_ekf.records import IssuedCommand, LinkCounters, WheelIdentity, WheelSample

LIMITS = SafetyLimits(0.6, 5.0, 440.0, 60.0, 0.5)
PACKAGE = Path(__file__).parents[2] / "rw_ekf"


class ScriptedWheel:
    """A driver that answers writes from a script: "ok", "timeout", another reason, or an error; then "ok" for ever."""

    def __init__(self, *script: str | DriverError) -> None:
        self.source = "scripted"
        self.link = LinkCounters()
        self.identity: WheelIdentity | None = None
        self.script = list(script)
        self.sent: list[float] = []

    def read(self, timeout_s: float) -> WheelSample | None:
        return None

    def stop_current(self, by: str | None = None) -> IssuedCommand:
        return self.command_current(0.0)

    def command_current(self, current_A: float) -> IssuedCommand:
        self.sent.append(current_A)
        answer = self.script.pop(0) if self.script else "ok"
        if isinstance(answer, DriverError):
            raise answer
        return IssuedCommand(current_A, 0.01, answer == "ok", None if answer == "ok" else answer)

    def close(self) -> None:
        """Nothing to release."""


def guard_of(*script: str | DriverError) -> tuple[CurrentGuard, ScriptedWheel, VirtualClock]:
    wheel, clock = ScriptedWheel(*script), VirtualClock()
    assert isinstance(wheel, WheelDriver)
    guard = CurrentGuard(wheel, LIMITS, clock)
    clock.sleep(1.0)
    return guard, wheel, clock


def sample(speed: float | None = 10.0, command_A: float | None = None, heat: float | None = 20.0) -> WheelSample:
    return WheelSample(1.0, speed, current_command_A=command_A, temperature_degC=heat)


def test_a_confirmed_write_is_sent_once_and_reported_as_it_went() -> None:
    """One frame, acknowledged, with the delay that the driver measured."""
    guard, wheel, _ = guard_of()
    assert guard.write(0.2, sample()) == IssuedCommand(0.2, 0.01, True, None)
    assert wheel.sent == [0.2]


def test_an_unconfirmed_write_is_retried_once_where_telemetry_does_not_tell_the_current() -> None:
    """The second try is confirmed: the command counts. Where the next sample tells, there is no second."""
    guard, wheel, _ = guard_of("timeout")
    assert guard.write(0.2, sample()).acknowledged
    assert wheel.sent == [0.2, 0.2]
    assert not guard.doubtful
    guard, wheel, _ = guard_of("timeout")
    assert not guard.write(0.2, sample(command_A=0.0)).acknowledged
    assert wheel.sent == [0.2]
    assert guard.doubtful


def test_a_zero_nobody_confirms_is_written_again_whatever_telemetry_tells() -> None:
    """Zero does no harm twice."""
    guard, wheel, _ = guard_of("timeout")
    assert guard.write(0.0, sample(command_A=0.2)).acknowledged
    assert wheel.sent == [0.0, 0.0]


def test_a_write_nobody_confirms_reports_the_current_before_it() -> None:
    """Two tries without an answer: the old current most likely holds, the guard is in doubt, and then recovers."""
    guard, wheel, clock = guard_of("ok", "timeout", "timeout")
    guard.write(0.2, sample())
    clock.sleep(0.1)
    issued = guard.write(0.3, sample())
    assert (issued.current_A, issued.acknowledged, issued.reason) == (0.2, False, "timeout")
    assert wheel.sent == [0.2, 0.3, 0.3]
    assert guard.doubtful
    clock.sleep(0.1)
    assert guard.write(0.3, sample()).acknowledged
    assert not guard.doubtful


def test_a_wheel_that_refuses_a_current_gets_zero_instead_of_keeping_the_old_one() -> None:
    """Refused twice (out of range): zero is written, and reported with the wheel's own reason."""
    guard, wheel, clock = guard_of("ok", "out_of_range", "out_of_range")
    guard.write(0.2, sample())
    clock.sleep(0.1)
    issued = guard.write(0.5, sample())
    assert (issued.current_A, issued.acknowledged, issued.reason) == (0.0, True, "out_of_range")
    assert wheel.sent == [0.2, 0.5, 0.5, 0.0]


def test_slew_begins_at_what_the_wheel_says_is_in_force() -> None:
    """A wheel that restarted (its command is zero again) is not thrown back to the old current in one step."""
    guard, _, clock = guard_of()
    guard.write(0.6, sample())
    clock.sleep(0.02)
    issued = guard.write(0.6, sample(command_A=0.0))
    assert issued.reason == "slew"
    assert 0.09 < issued.current_A < 0.13


@pytest.mark.parametrize("nonsense", [float("nan"), float("inf")])
def test_telemetry_that_is_not_a_number_moves_nothing(nonsense: float) -> None:
    """A current in force of NaN or infinity is ignored: slew goes on from what was written last."""
    guard, _, clock = guard_of()
    guard.write(0.6, sample())
    clock.sleep(0.02)
    assert guard.write(0.6, sample(command_A=nonsense)).current_A == 0.6


def test_after_a_zero_nobody_confirmed_the_way_up_begins_at_zero() -> None:
    """However long the silence was, the first current after it is one slew step, not a jump."""
    guard, _, clock = guard_of("ok", "timeout")
    guard.write(0.6, sample())
    clock.sleep(30.0)
    assert not guard.zero(within_s=0.0)
    clock.sleep(0.02)
    assert abs(guard.write(0.6, sample()).current_A) < 0.13


def test_speed_and_temperature_of_earlier_samples_still_count() -> None:
    """A sample without a speed or a temperature does not lift a limit that the one before it set."""
    guard, _, clock = guard_of()
    guard.write(0.1, sample(speed=500.0))
    assert guard.write(0.1, sample(speed=None)).current_A == 0.0
    guard.write(0.1, sample(speed=1.0, heat=70.0))
    assert guard.write(0.1, sample(heat=None)).current_A == 0.0
    clock.sleep(1.0)
    assert guard.write(0.1, sample(heat=20.0)).current_A == 0.1


def test_zero_is_repeated_until_it_is_confirmed() -> None:
    """Three lost answers, then one: zero is confirmed and True is returned."""
    wheel = ScriptedWheel("timeout", "refused", "timeout")
    assert CurrentGuard(wheel, LIMITS, VirtualClock()).zero(within_s=2.0)
    assert wheel.sent == [0.0] * 4


def test_zero_gives_up_in_time_without_raising() -> None:
    """A wheel that never confirms: False, after more than one try."""
    wheel = ScriptedWheel(*["timeout"] * 100)
    assert not CurrentGuard(wheel, LIMITS, VirtualClock()).zero(within_s=0.2)
    assert 2 <= len(wheel.sent) < 20


def test_zero_never_raises_when_the_line_is_lost() -> None:
    """A line that fails gives False, and leaves the guard in doubt of what flows."""
    guard = CurrentGuard(ScriptedWheel(DriverError("gone")), LIMITS, VirtualClock())
    assert not guard.zero()
    assert guard.doubtful


def test_only_the_guard_and_the_replayed_record_call_command_current() -> None:
    """In all of rw_ekf they are called in guard.py once, and command_current in loop.py to ask a record."""
    callers = []
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            for name in ("command_current", "stop_current"):
                named = isinstance(node, ast.Attribute) and node.attr == name
                hidden = isinstance(node, ast.Constant) and node.value == name
                if named or hidden:
                    callers.append((name, path.relative_to(PACKAGE).as_posix()))
    assert sorted(callers) == [
        ("command_current", "live/guard.py"),
        ("command_current", "live/loop.py"),
        ("stop_current", "live/guard.py"),
    ]


def test_a_replayed_record_cannot_reach_a_wheel() -> None:
    """What loop.py calls command_current on is only ever a record: nothing else in rw_ekf uses command_of_record."""
    users = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if "command_of_record" in path.read_text(encoding="utf-8")
    }
    assert users == {"live/loop.py", "log_replay.py"}
