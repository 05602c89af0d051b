"""Opening a port: nothing is reset by it, and if something was, it is found."""

from __future__ import annotations

import termios
from typing import Any

import pytest
import serial

from rw_ekf.clock import SystemClock
from rw_ekf.driver import ControlLines
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.drivers.line.wire_map import WireMap
from tests.faults.rig import EACH_FAMILY_ON_A_LINE, let_pass, port_of
from tests.live.bench import Bench, wait_for
from tests.serial_wheels import open_serial_wheel

pytestmark = [EACH_FAMILY_ON_A_LINE, pytest.mark.usefixtures("family")]

CLOCK = SystemClock()


class Reported(serial.Serial):
    """A port that notes in which order it is set up."""

    calls: list[tuple[str, Any]]

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self.calls = []
        super().__init__(*arguments, **options)

    def open(self) -> None:
        self.calls.append(("open", None))
        super().open()

    def _update_dtr_state(self) -> None:
        self.calls.append(("dtr", self.dtr))

    def _update_rts_state(self) -> None:
        self.calls.append(("rts", self.rts))

    def set_low_latency_mode(self, low_latency_settings: bool) -> None:
        self.calls.append(("low_latency", low_latency_settings))
        super().set_low_latency_mode(low_latency_settings)  # on a pty: ValueError


@pytest.mark.parametrize("lines", [ControlLines(), ControlLines(False, True), ControlLines(True, False)])
def test_the_modem_lines_are_set_before_opening_and_not_touched_again(
    bench: Bench, wire_map: WireMap, monkeypatch: pytest.MonkeyPatch, lines: ControlLines
) -> None:
    """Row 6: `open` finds both as they shall be, nothing sets them later, low latency is tried."""
    made: list[Reported] = []

    def for_url(url: str, do_not_open: bool = False, **options: Any) -> Reported:
        assert do_not_open
        made.append(Reported(None, **options))
        made[0].port = url
        return made[0]

    monkeypatch.setattr(serial, "serial_for_url", for_url)
    wheel = open_serial_wheel(bench.port, wire_map, CLOCK, 0.15, control=lines)
    assert wheel.read(1.0) is not None
    wheel.close()
    assert made[0].calls == [("open", None), ("dtr", lines.dtr), ("rts", lines.rts), ("low_latency", True)]


def test_closing_the_port_drops_no_line(wheel: SerialWheel) -> None:
    """Row 6: HUPCL is off, so that the next opening raises nothing."""
    assert not termios.tcgetattr(port_of(wheel)._serial.fd)[2] & termios.HUPCL
    assert wheel.read(1.0) is not None


def test_an_opening_that_resets_the_wheel_is_found(bench: Bench, wheel: SerialWheel, wire_map: WireMap) -> None:
    """Row 6: opened again, the wheel restarted: said, a new segment, who answers asked again; then as before."""
    if bench.protocol == "odrive-ascii-wheel":
        pytest.skip("it tells nothing of a restart, nor who it is; it is made ready anew behind every opening")
    first = wheel.read(1.0)
    assert first is not None
    wheel.command_current(0.1)
    bench.registers.restart()
    again = open_serial_wheel(bench.port, wire_map, CLOCK, 0.15, probe=False, previous=wheel)
    assert again.identity is None
    sample = next(filter(None, (again.read(1.0) for _ in range(4))), None)  # a boot loader refuses until it is told
    assert sample is not None
    assert sample.news is not None
    assert sample.news[0] == "wheel_restarted"
    assert sample.segment > first.segment
    assert sample.current_command_A in (0.0, None)
    after = again.read(1.0)
    assert after is not None
    wait_for(lambda: again.read(1.0) is not None and again.identity is not None)
    assert (after.news, after.segment) == (None, sample.segment)
    again.close()


def test_what_comes_just_after_opening_is_let_pass(bench: Bench, wheel: SerialWheel, wire_map: WireMap) -> None:
    """Row 6: replies to whoever was here before, and noise of the plug, are no readings of the new line."""
    bench.fault("hold/from@0s:1h")
    let_pass(wheel)
    assert wheel.read(0.05) is None  # its reply is held ...
    wheel.close()
    # A line of text has no mark by which its beginning is found behind junk.
    bench.fault("insert/from:1:60" if "ascii" not in bench.protocol else "")
    again = open_serial_wheel(bench.port, wire_map, CLOCK, 0.15)
    bench.fault("")
    assert again.read(1.0) is not None
    assert again.link.timeouts == 0
    again.close()
