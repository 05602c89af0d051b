"""Writes that the wheel refuses, or of which nobody knows whether they acted."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from rw_ekf.clock import SystemClock
from rw_ekf.driver import ZERO_BY_MODE, ZERO_BY_RESET
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.live.guard import CurrentGuard, SafetyLimits
from tests.faults.rig import EACH_FAMILY
from tests.live.bench import ROOT, Bench, rw_ekf, served_wheel, wire_map_of
from tests.live.daemon import run
from tests.live.test_line_faults import fault
from tests.serial_wheels import open_serial_wheel

# Of each family but where the command is read back, which NSP does not tell.

SPEED = 133
LIMITS = SafetyLimits(0.6, 1.0e6, 400.0, 60.0, 0.5)


def guard_over(wheel: SerialWheel) -> tuple[CurrentGuard, list[str]]:
    """The guard of a wheel, and the events that it says."""
    stated: list[str] = []
    return CurrentGuard(wheel, LIMITS, SystemClock(), say=lambda event, text: stated.append(event)), stated


@pytest.mark.parametrize(
    ("text", "known_A", "reason"),
    [
        ("nack/current_command:3", 0.1, "out_of_range"),
        ("nack/current_command:4", 0.1, "refused_in_this_mode"),
        ("nack/current_command:9", 0.1, "status_9"),
        ("nack-acted/current_command:4", 0.2, "acted_though_refused_in_this_mode"),
        ("silence/current_command", 0.2, None),
        ("drop/to:1/2", 0.1, "timeout"),
    ],
)
def test_a_write_that_may_have_acted_is_read_back(
    bench: Bench, wheel: SerialWheel, text: str, known_A: float, reason: str | None
) -> None:
    """Row 14: refused, refused though done, not answered, lost: telemetry says what is in force; one write only."""
    assert wheel.command_current(0.1).acknowledged
    bench.fault(text)
    wheel._line.request(SPEED, b"", 2)  # so that of every second message the write is the first that is lost
    before = len(bench.recorder.writes_A())
    issued = wheel.command_current(0.2)
    assert issued.current_A == pytest.approx(known_A)
    assert (issued.acknowledged, issued.reason) == (True, reason)
    assert bench.registers.command_A == pytest.approx(known_A)
    assert len(bench.recorder.writes_A()) - before <= 1
    bench.fault("")
    again = wheel.command_current(0.3)
    assert (again.acknowledged, again.reason) == (True, None)


@pytest.mark.parametrize(
    ("text", "event", "idle"),
    [
        ("nack/current_command", ZERO_BY_MODE, True),
        ("nack/current_command,nack/mode", ZERO_BY_RESET, True),
        ("nack/current_command,nack-acted/mode", ZERO_BY_MODE, True),
        ("nack/current_command,nack/mode,nack/reset", None, False),
    ],
)
def test_a_zero_that_is_refused_is_enforced_otherwise(
    bench: Bench, wheel: SerialWheel, text: str, event: str | None, idle: bool
) -> None:
    """Row 14: by mode idle, then by reset, said once; where all is refused it is not confirmed; then all as before."""
    guard, stated = guard_over(wheel)
    sample = wheel.read(1.0)
    assert sample is not None
    assert guard.write(0.3, sample).acknowledged
    bench.fault(text)
    assert guard.zero(0.0) is idle
    assert guard.zero(0.0) is idle  # in force already: nothing is done twice
    assert (bench.registers.command_A == 0.0) is idle
    assert stated == ([] if event is None else [event])
    bench.fault("")
    assert guard.zero(0.5)
    assert bench.registers.command_A == 0.0
    after = wheel.read(1.0)
    assert after is not None
    assert guard.write(0.3, after).acknowledged


def test_a_map_without_mode_and_reset_says_that_zero_is_refused(tmp_path: Path) -> None:
    """Row 14: nothing to fall back to: unconfirmed, and confirmed as soon as the wheel takes it again."""
    content = yaml.safe_load((ROOT / "config" / "sunspace-wheel.yaml").read_text(encoding="utf-8"))
    content["registers"] = [r for r in content["registers"] if r["name"] not in ("mode", "reset")]
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    with served_wheel(tmp_path) as bench:
        wheel = open_serial_wheel(bench.port, wire_map_of(str(tmp_path / "map.yaml")), SystemClock(), 0.15)
        guard, stated = guard_over(wheel)
        wheel.command_current(0.3)
        bench.fault("nack/current_command")
        assert not guard.zero(0.0)
        assert stated == []
        bench.fault("")
        assert guard.zero(0.0)
        wheel.close()


@EACH_FAMILY
def test_the_daemon_says_how_it_stopped_a_wheel_that_refuses_zero(timed: Bench) -> None:
    """Row 14: refused in mid-run: zero by mode idle, an event and a finding; then the profile goes on."""
    strong = {"amplitude_A": 0.4}  # beyond what telemetry may say of a current that is in force
    ran = run(timed, 2.6, *fault(timed, 0.8, 1.6, "nack/current_command"), command=strong)
    assert ZERO_BY_MODE in ran.notes.events
    assert any("its mode was set to idle instead" in text for text in ran.outcome.findings)
    refusals = {"refused_in_this_mode", "not_taken"}  # by a status, or by telemetry that says so
    assert [c for e, c in ran.notes.stated if e == "command_changed" and c.get("reason") in refusals]
    assert ran.outcome.zero_confirmed
    assert any(abs(a) > 0.01 for a in timed.recorder.writes_A()[-6:-1])
    assert ran.outcome.statistics.rejected <= 2


@EACH_FAMILY
def test_stop_says_how_it_stopped_a_wheel_that_refuses_zero(bench: Bench) -> None:
    """Row 14: `rw-ekf stop`: status 0, the warning names what was done, and the wheel has no current."""
    bench.registers.watchdog_s = None  # it would have let go by itself before a program has started
    bench.registers._command_current(0.3)
    bench.fault("nack/current_command")
    done = rw_ekf("stop", "--config", str(bench.config()))
    assert done.returncode == 0, done.stderr
    assert "its mode was set to idle instead" in done.stderr
    assert bench.registers.command_A == 0.0
    assert bench.registers.wire_map.current_command.id in bench.recorder.ids()
