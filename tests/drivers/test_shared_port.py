"""One port for several ends: opened once, dead for all when it fails, and nobody waits twice in a turn."""

from __future__ import annotations

from typing import Any

import pytest
import serial

from rw_ekf.clock import Slot, VirtualClock
from rw_ekf.drivers.line.framing import RegisterCodec
from rw_ekf.drivers.line.serial_link import SerialLink
from rw_ekf.drivers.line.serial_port import POLL_S, PortSettings
from rw_ekf.drivers.line.shared_port import SharedPort
from rw_ekf.drivers.line.wire_layout import Framing, LineSettings

SETTINGS = PortSettings("nowhere", 115200, LineSettings())


class FakePort:
    """A port on which nothing comes by itself; what is written is kept, and it can be broken."""

    def __init__(self, clock: VirtualClock) -> None:
        self.clock = clock
        self.written: list[bytes] = []
        self.coming = b""
        self.is_broken = self.is_closed = False

    @property
    def in_waiting(self) -> int:
        if self.is_broken:
            raise serial.SerialException("gone")
        return len(self.coming)

    def read(self, size: int) -> bytes:
        if not self.coming:
            self.clock.sleep(POLL_S)
        came, self.coming = self.coming[:size], self.coming[size:]
        return came

    def write(self, content: bytes) -> None:
        self.written.append(bytes(content))

    def reset_input_buffer(self) -> None:
        self.coming = b""

    def reset_output_buffer(self) -> None:
        pass

    def close(self) -> None:
        self.is_closed = True


class Opened:
    """Every port that was opened, in order."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.ports: list[FakePort] = []

    def __call__(self, settings: PortSettings, write_timeout_s: float) -> Any:
        self.ports.append(FakePort(self.clock))
        return self.ports[-1]


def test_ends_share_one_opening_and_the_last_closes_it() -> None:
    """Two ends, one port; with a port that is kept it stays open without an end."""
    for keeps in (False, True):
        opened = Opened()
        shared = SharedPort(opened, opened.clock, keeps=keeps)
        first, second = (shared.end()(SETTINGS, 0.1) for _ in range(2))
        assert (first.is_fresh, second.is_fresh, len(opened.ports)) == (True, False, 1)
        first.close()
        first.close()
        assert not opened.ports[0].is_closed
        second.close()
        assert opened.ports[0].is_closed is not keeps


def test_a_port_that_fails_is_closed_and_dead_for_every_end_until_one_is_opened_again() -> None:
    """The one that meets the failure closes it (no second descriptor holds the name); the next end opens it anew."""
    opened = Opened()
    shared = SharedPort(opened, opened.clock)
    first, second = (shared.end()(SETTINGS, 0.1) for _ in range(2))
    opened.ports[0].is_broken = True
    with pytest.raises(serial.SerialException, match="gone"):
        _ = first.in_waiting
    assert opened.ports[0].is_closed
    with pytest.raises(serial.PortNotOpenError):
        second.write(b"x")
    third = shared.end()(SETTINGS, 0.1)
    third.write(b"again")
    second.close()  # of the port before: none of its business
    assert opened.ports[1].written == [b"again"]
    assert not opened.ports[1].is_closed


def test_a_port_on_which_nobody_is_heard_is_opened_anew_with_the_next_end() -> None:
    """Not while anybody is: one byte a second keeps it."""
    opened = Opened()
    shared = SharedPort(opened, opened.clock)
    end = shared.end()(SETTINGS, 0.1)
    for _ in range(20):
        opened.clock.sleep(1.0)
        opened.ports[0].coming = b"."
        assert end.read(1) == b"."
    shared.end()(SETTINGS, 0.1)
    assert len(opened.ports) == 1
    opened.clock.sleep(6.0)
    shared.end()(SETTINGS, 0.1)
    assert len(opened.ports) == 2


def test_after_a_time_out_nothing_is_sent_before_the_next_slot() -> None:
    """Ten requests in a turn to a wheel that is silent: one is sent, one time-out passes; the next turn sends again."""
    opened = Opened()
    clock = opened.clock
    slot = Slot(clock, 0.1, 0.03)
    link = SerialLink(SETTINGS, RegisterCodec(Framing()), 0.025, clock, None, SharedPort(opened, clock).end(slot))
    for turn in range(1, 6):
        clock.sleep(slot.next_s() - clock.monotonic())
        began_s = clock.monotonic()
        assert all(link.request(137, b"", 20).data is None for _ in range(10))
        assert clock.monotonic() - began_s < 0.025 + 0.003
        assert len(opened.ports[0].written) == turn
        assert link.counters.requests == link.counters.timeouts == turn
