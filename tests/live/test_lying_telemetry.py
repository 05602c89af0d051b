"""Whatever one field of telemetry says: what is written, how fast the wheel truly is, what a confirmed zero means."""

from __future__ import annotations

import pytest

from rw_ekf.clock import VirtualClock
from rw_ekf.live.guard import CurrentGuard, SafetyLimits, SpeedLimit
from rw_ekf.records import IssuedCommand, LinkCounters, WheelIdentity, WheelSample
from tools.measure.lying_telemetry import FAMILIES, FIELDS, KINDS, fields_of, sentence_about

LIMITS = SafetyLimits(0.6, 0.5, 40.0, 60.0, 0.5)
MOST = 1.5  # of the limit


@pytest.mark.slow
@pytest.mark.parametrize("field", sorted(set(FIELDS)))
def test_no_lie_moves_the_wheel(field: str) -> None:
    """Each kind of lie in each field, twice: no write outside [0, last, asked], T within 1.5 L, no false zero."""
    for i, kind in enumerate(KINDS):
        for seed in (8000 + i, 8100 + i):
            reported = sentence_about(seed, field=field, kind=kind, lasts_s=30.0)
            assert reported.outside == 0, reported
            assert reported.speed_over_limit <= MOST, reported
            assert not reported.is_false_zero, reported


@pytest.mark.slow
@pytest.mark.parametrize("family", sorted(set(FAMILIES) - {"sunspace-wheel"}))
def test_no_lie_of_another_family_moves_the_wheel(family: str) -> None:
    """Each field that it tells, with two kinds of lie each: as of the registers above."""
    for i, field in enumerate(dict.fromkeys(fields_of(family))):
        for seed, kind in ((8200 + i, KINDS[i % len(KINDS)]), (8300 + i, KINDS[(i + 4) % len(KINDS)])):
            reported = sentence_about(seed, family, field=field, kind=kind, lasts_s=30.0)
            assert reported.outside == 0, reported
            assert reported.speed_over_limit <= MOST, reported
            assert not reported.is_false_zero, reported


ANSWERING = sorted(set(FAMILIES) - {"can-wheel"})  # on a bus nothing answers a command


@pytest.mark.parametrize(
    ("family", "answers"),
    [*((family, True) for family in sorted(FAMILIES)), *((family, False) for family in ANSWERING)],
)
def test_a_wheel_that_is_read_but_takes_no_commands_is_let_go_of(family: str, answers: bool) -> None:
    """From 11 s on no current is taken, answered or not, by 0.2 A beyond 200 rpm: SAFE, in time, and zero by idle."""
    reported = sentence_about(5001, family, acts=False, answers=answers, lasts_s=30.0)
    assert reported.safe, reported
    assert reported.speed_over_limit <= 1.1, reported
    assert reported.confirmed, reported
    assert reported.current_at_end_A == 0.0, reported


@pytest.mark.parametrize(
    ("family", "field"),
    [("vesc-wheel", "current"), ("can-wheel", "current_command"), ("odrive-ascii-wheel", "current_command")],
)
@pytest.mark.parametrize("kind", ["flip", "scale"])
def test_a_telemetry_that_bears_no_command_out_is_safe(family: str, field: str, kind: str) -> None:
    """It tells each current with the other sign, or .37 of it, from 12 s on: a pulse a turn, though each is refused."""
    reported = sentence_about(9002, family, field=field, kind=kind, size=0.3, begins_s=12.0, lasts_s=40.0)
    assert reported.safe, reported
    assert reported.confirmed, reported


@pytest.mark.parametrize("seed", [5000, 5013])
def test_a_wheel_that_tells_no_current_is_not_at_zero_while_it_does_not_slow_down(seed: int) -> None:
    """It acknowledges every write and keeps what it had: at its own steady speed nothing but that shows it."""
    reported = sentence_about(seed, "nsp-wheel-torque", acts=False, lasts_s=30.0)
    assert not reported.is_false_zero, reported


@pytest.mark.parametrize("family", ["nsp-wheel-torque", "sunspace-wheel"])
@pytest.mark.parametrize(("seed", "share"), [(5001, 0.6), (5004, 0.2), (5007, 0.2)])
def test_a_zero_that_leaves_some_of_the_current_on_is_not_called_zero(family: str, seed: int, share: float) -> None:
    """Acknowledged each time: let go of by mode idle, and within what a lying reading may do to the speed."""
    reported = sentence_about(seed, family, fault=f"residue:{share}", lasts_s=25.0)
    assert reported.confirmed, reported
    assert reported.current_at_end_A == 0.0, reported
    assert reported.speed_over_limit <= 1.1, reported


@pytest.mark.parametrize("seed", [7001, 7002, 7003])
def test_a_wheel_that_acknowledges_and_does_not_act_is_given_zero_in_another_way(seed: int) -> None:
    """From ten seconds on it keeps its current whatever is written: at the end confirmed means zero, by mode idle."""
    reported = sentence_about(seed, acts=False, begins_s=10.0, lasts_s=25.0)
    assert reported.confirmed
    assert reported.outside == 0
    assert not reported.is_false_zero
    assert reported.current_at_end_A == 0.0


@pytest.mark.parametrize("seed", [7011, 7012, 7013])
def test_a_dead_line_that_hums_is_safe(seed: int) -> None:
    """In mid-run the speed stays at what it was, with noise on it: found before the wheel is at 1.5 of the limit."""
    reported = sentence_about(seed, field="speed", kind="hum", begins_s=12.0, lasts_s=40.0)
    assert reported.safe
    assert reported.speed_over_limit <= MOST


class TellingWheel:
    """A driver that takes every command, and reads what it is told to read."""

    def __init__(self, *ways: str) -> None:
        """ways: what else than a current of zero lets go of the current."""
        self.source, self.link = "telling", LinkCounters()
        self.identity: WheelIdentity | None = None
        self.ways = ways
        self.in_force_A = 0.2
        self.sent: list[float | str] = []

    def read(self, timeout_s: float) -> WheelSample | None:
        return WheelSample(1.0, 5.0, current_A=self.in_force_A, current_command_A=self.in_force_A)

    def command_current(self, current_A: float) -> IssuedCommand:
        self.sent.append(current_A)
        return IssuedCommand(current_A)

    def stop_current(self, by: str | None = None) -> IssuedCommand:
        self.sent.append(by or 0.0)
        if by in self.ways:
            self.in_force_A = 0.0
        return IssuedCommand(0.0, reason=by)

    def close(self) -> None:
        """Nothing to release."""


@pytest.mark.parametrize(
    ("ways", "sent"),
    [
        (["zero_by_mode_idle"], [0.0, "zero_by_mode_idle"]),
        (["zero_by_reset"], [0.0, "zero_by_mode_idle", "zero_by_reset"]),
    ],
)
def test_a_zero_that_is_acknowledged_and_not_in_force_is_enforced(ways: list[str], sent: list[float | str]) -> None:
    """Read back as 0.2 A: idle mode, then a reset; confirmed by whichever lets go."""
    wheel = TellingWheel(*ways)
    assert CurrentGuard(wheel, LIMITS, VirtualClock(), 0.1).stand_down()
    assert wheel.sent == sent


def test_a_zero_that_nothing_enforces_is_not_confirmed() -> None:
    """All three are acknowledged and none acts: False, and each was tried once."""
    stated: list[str] = []
    wheel = TellingWheel()
    guard = CurrentGuard(wheel, LIMITS, VirtualClock(), 0.1, lambda event, text: stated.append(event))
    assert not guard.stand_down()
    assert wheel.sent == [0.0, "zero_by_mode_idle", "zero_by_reset"]
    assert stated.count("zero_not_in_force") == 3


def test_a_limit_that_counts_in_part_is_said_once_until_it_is_whole_again() -> None:
    """Shares of 1, .85, .95, .85, 1, .85: said at the first .85 and at the last."""
    stated: list[str] = []
    clock = VirtualClock()
    guard = CurrentGuard(TellingWheel(), LIMITS, clock, 0.1, lambda event, text: stated.append(text))
    reported = []
    for share in (1.0, 0.85, 0.95, 0.85, 1.0, 0.85):
        guard.speed_limit = lambda share=share: SpeedLimit(None, share)  # type: ignore[misc]
        clock.sleep(1.0)
        guard.write(0.1, WheelSample(1.0, 1.0))
        reported.append(len(stated))
    assert reported == [0, 1, 1, 1, 1, 2]
    assert "85% of limits.speed_rpm" in stated[0]


@pytest.mark.parametrize("reported_A", [3.2767, -3.2768, 0.6, -0.6])
def test_the_slew_never_begins_beyond_what_was_written(reported_A: float) -> None:
    """Telemetry says that a large current is in force: the next write lies between zero, the last and the request."""
    wheel, clock = TellingWheel(), VirtualClock()
    guard = CurrentGuard(wheel, LIMITS, clock, 0.1)
    last = 0.0
    for wanted in (0.06, 0.06, -0.05, 0.3, 0.0, -0.2):
        clock.sleep(0.1)
        written = guard.write(wanted, WheelSample(1.0, 1.0, current_command_A=reported_A)).current_A
        assert min(0.0, last, wanted) <= written <= max(0.0, last, wanted)
        last = written


def test_the_speed_by_charge_counts_against_the_limit_too() -> None:
    """The reading says 1 rad/s, the charge 50 of 40: only a current that brakes by it is written."""
    wheel, clock = TellingWheel(), VirtualClock()
    guard = CurrentGuard(wheel, LIMITS, clock, 0.1)
    guard.speed_limit = lambda: SpeedLimit(50.0, 1.0)
    clock.sleep(1.0)
    driven = guard.write(0.2, WheelSample(1.0, 1.0))
    assert (driven.current_A, driven.reason) == (0.0, "over_speed")
    clock.sleep(1.0)
    assert guard.write(-0.2, WheelSample(1.1, 1.0)).current_A == -0.2
