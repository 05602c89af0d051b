"""A wheel on a bus of python-can: unasked telemetry, other nodes, a controller in trouble, a bus that comes back."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.clock import SystemClock
from rw_ekf.drivers.can import can_bus
from rw_ekf.drivers.can.can_frames import CanFrame
from rw_ekf.drivers.can.can_hearing import BUS_OFF, CONTROLLER, PASSIVE, RESTARTED
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.errors import DriverError
from tests.live.bench import protocol_named, wait_for
from tests.live.can_bus import BusBench, codec_of, on_a_bus, opened
from tests.live.daemon import run

pytest.importorskip("cantools")
can = pytest.importorskip("can")

MOTION, COMMAND = 0x181, 0x201


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[BusBench]:
    with on_a_bus(tmp_path) as made:
        yield made


@pytest.fixture
def wheel(bench: BusBench) -> Iterator[SerialWheel]:
    made = opened(bench)
    yield made
    made.close()


def test_readings_are_the_newest_and_commands_are_borne_out_by_them(bench: BusBench, wheel: SerialWheel) -> None:
    """Ten looks 30 ms apart: none twice, each with what other messages tell; then a current that is in force."""
    last_s = 0.0
    for _ in range(10):
        time.sleep(0.03)
        sample = wheel.read(0.5)
        assert sample is not None
        assert sample.speed_rad_s == pytest.approx(20.0, abs=1.5)
        assert sample.temperature_degC == pytest.approx(20.0, abs=0.5)
        assert sample.bus_voltage_V == pytest.approx(28.0)
        assert sample.time_s > last_s
        last_s = sample.time_s
    assert wheel.identity is not None
    assert wheel.identity.serial_number == 1
    issued = wheel.command_current(0.25)
    assert (issued.current_A, issued.acknowledged, issued.reason) == (0.25, True, None)
    assert bench.registers.command_A == pytest.approx(0.25)
    assert wheel.stop_current().acknowledged
    assert bench.registers.command_A == 0.0
    assert wheel.link.foreign == wheel.link.damaged == 0


def test_frames_that_wait_are_as_old_as_they_are(bench: BusBench, wheel: SerialWheel) -> None:
    """The wheel falls silent while nobody looks: what lies in the queue is missing, not fresh, whatever the hour is."""
    assert wheel.read(0.5) is not None
    time.sleep(0.05)
    bench.lost = True
    time.sleep(0.2)
    stale = wheel.link.stale
    assert wheel.read(0.02) is None
    assert wheel.link.stale > stale
    bench.lost = False
    assert wheel.read(0.5) is not None


def test_another_master_is_counted_said_and_never_taken_for_an_echo(bench: BusBench, wheel: SerialWheel) -> None:
    """A second node commands the wheel: foreign, with an event; telemetry tells what is in force; our own goes on."""
    frame = codec_of(bench, "Command").pack({"Current": 3000, "Enable": 1}, 77)
    wheel.command_current(0.1)
    bench.send(frame)
    wait_for(lambda: bench.registers.command_A == pytest.approx(0.3))
    time.sleep(0.03)
    sample = wheel.read(0.5)
    assert sample is not None
    assert sample.current_command_A == pytest.approx(0.3)
    assert sample.news is not None
    assert sample.news[0] == "other_master"
    assert wheel.link.foreign == 1
    assert wheel.command_current(0.1).acknowledged


def test_a_stranger_with_our_identifier_is_not_taken(bench: BusBench, wheel: SerialWheel) -> None:
    """A wrong length is damaged, a wrong checksum too; an extended identifier for a standard one is foreign."""
    bench.registers.faults.put()
    wild = bytes((0xFF, 0x7F, 0, 0, 0, 0, 0, 0))
    for frame in (CanFrame(MOTION, wild[:6]), CanFrame(MOTION, wild), CanFrame(MOTION, wild, extended=True)):
        bench.send(frame)
    bench.send(CanFrame(0x555, wild))  # of no concern
    time.sleep(0.03)
    for _ in range(3):
        sample = wheel.read(0.5)
        assert sample is not None
        assert sample.speed_rad_s == pytest.approx(20.0, abs=1.5)
    assert (wheel.link.damaged, wheel.link.foreign) == (2, 1)


def test_bus_off_is_a_lost_link_and_comes_back(bench: BusBench, wheel: SerialWheel) -> None:
    """A DriverError that says so, a state and a count; opened again with zero first, and on as before."""
    assert wheel.read(0.5) is not None
    bench.send(CanFrame(BUS_OFF, bytes(8), error=True))
    time.sleep(0.02)
    with pytest.raises(DriverError, match="bus-off"):
        wheel.read(0.5)
    assert (wheel.link.bus, wheel.link.bus_errors) == ("off", 1)
    again = opened(bench, probe=False, previous=wheel)
    assert again.stop_current().acknowledged
    assert again.read(0.5) is not None
    assert (again.link.bus, again.link.reconnects) == ("active", 1)
    again.close()


@pytest.mark.slow
def test_a_daemon_on_a_bus_that_goes_off_is_lost_says_why_and_tracks_again(tmp_path: Path) -> None:
    """LOST with the reason in the link's trouble, then TRACKING, and zero at the end; nothing is lost for good."""
    with on_a_bus(tmp_path, noise_rpm=1.0) as bench:
        off = CanFrame(BUS_OFF, bytes(8), error=True)
        ran = run(bench, 3.0, (1.0, lambda: bench.send(off)))
        lost = ran.notes.states.index("LOST")
        assert ran.notes.states[lost : lost + 3] == ["LOST", "CONNECTING", "TRACKING"]
        (reason,) = [c["reason"] for e, c in ran.notes.stated if e == "link_lost"]
        assert "bus-off" in reason
        assert ran.outcome.link.trouble is None
        assert ran.outcome.link.reconnects == 1
        assert ran.outcome.zero_confirmed
        assert bench.registers.command_A == 0.0


def test_error_passive_is_a_state_said_once(bench: BusBench, wheel: SerialWheel) -> None:
    """Three error frames: three counted, one event; active again when the controller says so."""
    for _ in range(3):
        bench.send(CanFrame(CONTROLLER, bytes((0, PASSIVE & 0x20, 0, 0, 0, 0, 0, 0)), error=True))
    time.sleep(0.02)
    news = [sample.news for sample in (wheel.read(0.5) for _ in range(4)) if sample is not None and sample.news]
    assert [event for event, _ in news] == ["bus_error_passive"]
    assert (wheel.link.bus, wheel.link.bus_errors) == ("passive", 3)
    bench.send(CanFrame(RESTARTED, bytes(8), error=True))
    time.sleep(0.02)
    assert wheel.read(0.5) is not None
    assert wheel.link.bus == "active"


def test_a_full_queue_blocks_no_tick_and_is_lost_in_the_end(
    bench: BusBench, wheel: SerialWheel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody acknowledges: commands stay unconfirmed and readings come on; after half a second it is a lost link."""
    full = can.CanOperationError("Transmit buffer full", 105)

    def refuse(*_: Any, **__: Any) -> None:
        raise full

    bus: Any = wheel._line.bus  # type: ignore[attr-defined]
    with monkeypatch.context() as patched:
        patched.setattr(bus._bus, "send", refuse)
        issued = wheel.command_current(0.3)
        assert (issued.current_A, issued.reason) == (0.0, "timeout")  # in force, as telemetry has it
        assert wheel.read(0.5) is not None
        time.sleep(0.6)
        with pytest.raises(DriverError, match="takes no frames"):
            wheel.command_current(0.3)
    assert bench.registers.command_A == 0.0
    again = opened(bench, probe=False, previous=wheel)
    assert again.command_current(0.3).acknowledged
    again.close()


def test_an_interface_that_fails_is_a_lost_link(
    bench: BusBench, wheel: SerialWheel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Down, or unplugged: whatever python-can raises becomes a DriverError that says what to check; then it is back."""
    bus: Any = wheel._line.bus  # type: ignore[attr-defined]

    def fail(*_: Any, **__: Any) -> None:
        raise can.CanOperationError("Failed to receive: Network is down", 100)

    with monkeypatch.context() as patched:
        patched.setattr(bus._bus, "recv", fail)
        with pytest.raises(DriverError, match=r"Network is down.*unplugged"):
            wheel.read(0.5)
    again = opened(bench, probe=False, previous=wheel)
    assert again.read(0.5) is not None
    again.close()


def test_a_clock_of_the_day_that_is_set_changes_no_age(
    bench: BusBench, wheel: SerialWheel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An hour forward and back: readings come, and none is taken for old or for new."""
    for by_s in (3600.0, -3600.0):
        monkeypatch.setattr(SystemClock, "utc", lambda self, by_s=by_s: _Hour(time.time() + by_s))
        assert all(wheel.read(0.5) is not None for _ in range(5))


class _Hour(float):
    def timestamp(self) -> float:
        return float(self)


def test_what_is_not_there_is_said_in_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    """No such interface, one that is down, a name that is none, and python-can not installed."""
    protocol = protocol_named("can-wheel")
    for port, words in (
        ("can:socketcan:can99", "there is no interface can99"),
        ("can:socketcan", "is no name of a CAN bus"),
        ("can:nonsense:x", "could not be opened"),
    ):
        with pytest.raises(DriverError, match=words):
            protocol.open_wheel(port, SystemClock(), 0.1)
    monkeypatch.setitem(sys.modules, "can", None)
    with pytest.raises(DriverError, match=r"pip install \"rw-ekf\[can\]\""):
        protocol.open_wheel("can:virtual:x", SystemClock(), 0.1)
    assert can_bus.CanPort.of("can:socketcan:can0#left") == ("socketcan", "can0")


def test_zero_from_outside_reaches_a_wheel_that_another_program_drives(bench: BusBench, wheel: SerialWheel) -> None:
    """What `stop` does beside a daemon that it may not end: a shared bus keeps nobody out, and it hears of it."""
    wheel.command_current(0.3)
    beside = opened(bench, probe=False, exclusive=False)
    assert beside.stop_current().acknowledged
    beside.close()
    assert bench.registers.command_A == 0.0
    time.sleep(0.03)
    sample = wheel.read(0.5)
    assert sample is not None
    assert sample.current_command_A == 0.0
    assert sample.news is not None
    assert sample.news[0] == "other_master"
    assert wheel.link.foreign == 1


def test_a_frame_of_ours_that_comes_back_is_no_other_master(bench: BusBench, wheel: SerialWheel) -> None:
    """A gateway that sends back what it hears: counted as old, not as somebody else's."""
    bench.echo = True
    assert wheel.command_current(0.2).acknowledged
    time.sleep(0.02)
    assert wheel.read(0.5) is not None
    assert (wheel.link.foreign, wheel.link.stale >= 1) == (0, True)
