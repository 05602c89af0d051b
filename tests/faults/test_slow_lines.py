"""Bytes that come in blocks, and bytes that nobody takes."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

import pytest

from rw_ekf.drivers.line.serial_link import SerialLink
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.records import RunState
from tests.faults.rig import EACH_FAMILY, LineWheel, is_unsolicited, port_of
from tests.live.bench import Bench, wait_for
from tests.live.daemon import run
from tests.live.test_line_faults import fault

pytestmark = [EACH_FAMILY, pytest.mark.usefixtures("family")]


def test_an_adapter_with_a_latency_timer_is_told(timed: Bench, timed_wheel: SerialWheel) -> None:
    """Row 23: bytes come every 16 ms: all samples come, what replies took and its jitter are told; it ends with it."""
    bench, wheel = timed, timed_wheel
    answered = _confirmed if is_unsolicited(wheel) else _read
    assert all(answered(wheel) for _ in range(20))
    quick_ms = wheel.link.reply_ms
    bench.fault("hold/from:16ms")
    assert all(answered(wheel) for _ in range(60))
    slow_ms, jitter_ms, longest_ms = wheel.link.reply_ms, wheel.link.reply_jitter_ms, wheel.link.reply_ms_max
    assert None not in (quick_ms, slow_ms, jitter_ms, longest_ms)
    assert slow_ms is not None
    assert quick_ms is not None
    assert slow_ms > quick_ms + 2.0
    assert jitter_ms is not None
    assert jitter_ms > 0.3
    bench.fault("")
    assert all(answered(wheel) for _ in range(150))
    assert wheel.link.reply_ms is not None
    assert wheel.link.reply_ms < slow_ms


def _read(wheel: SerialWheel) -> bool:
    return wheel.read(1.0) is not None


def _confirmed(wheel: SerialWheel) -> bool:
    """Nothing replies but what says that a command is in force."""
    return wheel.command_current(0.0).acknowledged


def test_a_reading_is_stamped_when_its_last_byte_came(timed_wheel: SerialWheel) -> None:
    """Row 23: not when the driver got round to it: an exchange ends with the read that brought the byte."""
    line, main = timed_wheel._line, timed_wheel._main
    exchange = line.request(main.id, b"", main.size)
    assert exchange.data is not None
    if isinstance(line, SerialLink):
        assert exchange.replied_s == line._came_s
    else:  # it came when its frames did, the last of which is not older than a cycle and what may lie between them
        assert 0.0 <= exchange.replied_s - exchange.received_by_wheel_s < 0.020


def test_output_that_nobody_takes_ends_at_its_deadline(bench: Bench, wheel: SerialWheel) -> None:
    """Row 24: the buffer is full: each request returns without a reply; when it is taken again, so are readings."""
    assert wheel.read(1.0) is not None
    bench.fault("block")
    port = port_of(wheel)._serial
    wait_for(lambda: _is_full(port.fd))
    timeouts = wheel.link.timeouts
    assert (wheel.read(0.2) is not None) is is_unsolicited(wheel)  # what comes unasked is not stopped by that
    issued = wheel.command_current(0.2)
    assert not issued.acknowledged or (is_unsolicited(wheel) and issued.current_A == 0.0)  # which telemetry tells
    assert wheel.link.timeouts >= timeouts + (1 if is_unsolicited(wheel) else 2) or issued.reason == "not_taken"
    bench.fault("")
    wait_for(lambda: wheel.read(0.5) is not None)
    assert all(wheel.read(1.0) is not None for _ in range(5))
    assert bench.registers.command_A == 0.0  # the current that could not be sent did not come late


def _is_full(descriptor: int) -> bool:
    """Write until nothing more is taken."""
    with contextlib.suppress(BlockingIOError):
        while os.write(descriptor, bytes(512)):
            pass
    return True


def test_the_daemon_whose_output_is_blocked_is_lost_and_comes_back(bench: Bench, timed: Bench) -> None:
    """Row 24: LOST while the far end takes nothing, then zero and TRACKING; on a bus it is heard, and it is said.

    There it takes a tty, which holds what nobody takes; where wheels are asked it makes no difference.
    """
    on_a_bus = bench.protocol == "can-wheel"
    line = bench if on_a_bus else timed
    patient = {"silence_s": 2.0 if on_a_bus else 0.3}  # a busy machine serves a tty late
    ran = run(line, 4.0, *fault(line, 1.0, 2.2, "block"), limits=patient)
    if on_a_bus:
        assert ran.notes.events.count("commands_not_taken") == 1
        assert ran.outcome.zero_confirmed
        assert ran.notes.states[-1] == "TRACKING"
        return
    lost = ran.notes.states.index("LOST")
    assert ran.notes.states[lost : lost + 3] == ["LOST", "CONNECTING", "TRACKING"]
    assert "silence" in ran.notes.events
    assert "telemetry_back" in ran.notes.events or "link_back" in ran.notes.events
    assert ran.outcome.zero_confirmed
    assert not ran.outcome.lost


def test_a_line_that_loses_one_reply_in_six_tells_the_temperature_often_enough(tmp_path: Path) -> None:
    """Row 10: a value that is asked last of several is lost in half of all turns; two minutes of that are not SAFE."""
    wheel = LineWheel(tmp_path, faults="drop/from:15%@10s")
    reported = wheel.run(120.0, command={"confirm_sign": False}).outcome.state
    assert reported.state is not RunState.SAFE, reported.reason
