"""One serial port for several wheels that speak in turn, each through an end of its own, with or without an echo.

An end has the methods of pyserial's ports that a `SerialLink` uses. The port is opened with the first end and closed
with the last, unless it is kept; or when it fails: then all ends are dead, and the first that is opened again opens the
port anew.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import serial

from rw_ekf.clock import Clock, Slot
from rw_ekf.drivers.line.echo import EchoCheck
from rw_ekf.drivers.line.line_errors import LINE_EXCEPTIONS
from rw_ekf.drivers.line.serial_port import PortSettings, close_serial_port

OpenPort = Callable[[PortSettings, float], Any]  # gives an open port as pyserial's are

_DEAF_S = 5.0  # a port on which nobody at all was heard for so long is opened anew with the next end


class SharedPort:
    """The port, and whether its adapter echoes. Only one thread may use it and its ends."""

    def __init__(self, open_port: OpenPort, clock: Clock, *, echoes: bool = False, keeps: bool = False) -> None:
        """keeps: the port stays open without an end, until `fail`."""
        self._open_port = open_port
        self._clock = clock
        self._echoes = echoes
        self._keeps = keeps
        self._ends: set[LineEnd] = set()
        self._heard_s = 0.0
        self._clean = bytearray()  # heard and not read yet, without echoes
        self.port: Any = None
        self.echo: EchoCheck | None = None

    @property
    def is_open(self) -> bool:
        """Whether the port is there, as far as is known."""
        return self.port is not None

    def end(self, slot: Slot | None = None) -> OpenPort:
        """What opens an end in place of a port. slot: of the wheel there; None: it may send at any time."""

        def open_end(settings: PortSettings, write_timeout_s: float) -> LineEnd:
            is_fresh = self._open(settings, write_timeout_s)
            made = LineEnd(self, slot, is_fresh=is_fresh)
            self._ends.add(made)
            return made

        return open_end

    def _open(self, settings: PortSettings, write_timeout_s: float) -> bool:
        """Open the port where it is not, or where nobody is heard on it; whether it was. Raises DriverError."""
        if self.port is not None and self._clock.monotonic() - self._heard_s > _DEAF_S:
            self.fail()
        if self.port is not None:
            return False
        self.port = self._open_port(settings, write_timeout_s)
        self.echo = EchoCheck() if self._echoes else None
        self._clean.clear()
        self._heard_s = self._clock.monotonic()
        return True

    def leave(self, end: LineEnd) -> None:
        """An end is closed; the last closes the port, unless that is kept."""
        self._ends.discard(end)
        if not self._ends and not self._keeps:
            self.fail()

    def fail(self) -> None:
        """Close the port, where it is open: every end is dead from now on."""
        self._ends.clear()
        port, self.port = self.port, None
        if port is not None:
            close_serial_port(port)

    def is_of(self, end: LineEnd) -> bool:
        """Whether an end is one of the port as it is open now."""
        return end in self._ends

    def waiting(self) -> int:
        """How many bytes have come that are no echo."""
        waiting = self.port.in_waiting
        if waiting and self.echo is not None:
            self._hear(waiting)
            return len(self._clean)
        return len(self._clean) + int(waiting)

    def read(self, size: int) -> bytes:
        """Up to `size` bytes that are no echo, as many as come within one look at the port."""
        if len(self._clean) < size:
            self._hear(size - len(self._clean))
        content = bytes(self._clean[:size])
        del self._clean[:size]
        return content

    def forget(self) -> None:
        """Forget what has come."""
        self.port.reset_input_buffer()
        self._clean.clear()

    def drop_unsent(self) -> None:
        """Forget what could not be sent."""
        self.port.reset_output_buffer()

    def _hear(self, size: int) -> None:
        content = self.port.read(size)
        if self.echo is not None:
            content = self.echo.heard(content)
        if content:
            self._heard_s = self._clock.monotonic()
            self._clean += content


class LineEnd:
    """A wheel's end of a shared port. After a failure of the port every method raises, as of a port that is closed."""

    def __init__(self, shared: SharedPort, slot: Slot | None, *, is_fresh: bool) -> None:
        """is_fresh: whether the port was opened with it, so that what comes now may be of before."""
        self.slot = slot
        self.is_fresh = is_fresh
        self._shared = shared

    @property
    def may_ask(self) -> bool:
        """Whether this is a time to send anything."""
        return self.slot is None or self.slot.may_ask

    @property
    def echoes_lost(self) -> int:
        """How many echoes have not come since the port was opened, whoever had sent."""
        return 0 if self._shared.echo is None else self._shared.echo.lost

    @property
    def awaits_echo(self) -> bool:
        """Whether what was sent last has not been heard yet, where it will be."""
        return self._shared.echo is not None and self._shared.echo.is_awaited

    def give_up(self) -> None:
        """A request has no answer: nothing more is requested before the next turn. Raises EchoError."""
        if self.slot is not None:
            self.slot.give_up()
        if self._shared.echo is not None:
            self._do(self._shared.echo.judge)

    @property
    def in_waiting(self) -> int:
        """How many bytes have come that are no echo."""
        waiting: int = self._do(self._shared.waiting)
        return waiting

    def read(self, size: int = 1) -> bytes:
        """Up to `size` bytes, as many as come within one look at the port."""
        content: bytes = self._do(lambda: self._shared.read(size))
        return content

    def write(self, content: bytes) -> None:
        """Send bytes. Raises SerialTimeoutException where the far end takes none."""
        if self._shared.echo is not None:
            self._do(lambda: self._shared.echo.note_sent(content))  # type: ignore[union-attr]
        self._do(lambda: self._shared.port.write(content))

    def reset_input_buffer(self) -> None:
        """Forget what has come."""
        self._do(self._shared.forget)

    def reset_output_buffer(self) -> None:
        """Forget what could not be sent."""
        self._do(self._shared.drop_unsent)

    def close(self) -> None:
        """Leave the line. Safe to call twice."""
        if self._shared.is_of(self):
            self._shared.leave(self)

    def _do(self, action: Callable[[], Any]) -> Any:
        if not self._shared.is_of(self):
            raise serial.PortNotOpenError
        try:
            return action()
        except serial.SerialTimeoutException:
            raise
        except LINE_EXCEPTIONS:
            self._shared.fail()
            raise
