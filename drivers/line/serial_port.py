"""Opening a port so that nothing is reset by it, nobody else listens, and bytes come as soon as they can.

What pyserial 3.5 and Linux do: opening a tty raises DTR and RTS; pyserial then sets both to what was requested, and
tolerates to fail where that was set before `open` and not behind it (a pseudo terminal has no such lines); closing the
last descriptor drops them unless HUPCL is off. So both stay up by default: what resets on an edge sees the one of the
first opening, and none when a daemon comes and goes. `exclusive` is an advisory lock (flock); TIOCEXCL makes the kernel
refuse a second opening.
"""

from __future__ import annotations

import contextlib
import os
import select
from typing import Any, NamedTuple

import serial

from rw_ekf.clock import Clock
from rw_ekf.driver import USUAL_LINES, ControlLines
from rw_ekf.drivers.line.line_errors import LINE_EXCEPTIONS, open_error
from rw_ekf.drivers.line.wire_layout import LineSettings

try:
    import fcntl
    import termios
except ImportError:  # not a POSIX system: what needs them is left out
    fcntl = termios = None  # type: ignore[assignment]

# How long one look at the port blocks. Setting pyserial's timeout per request would reprogram the port every time.
POLL_S = 0.002
# What comes just after opening is of whoever was here before, or of the plug: it is let pass until the line is quiet.
_QUIET_GAP_S, _LONGEST_GAP_S = 0.010, 0.100
_PARITIES = {"none": serial.PARITY_NONE, "even": serial.PARITY_EVEN, "odd": serial.PARITY_ODD}
_PSEUDO_TERMINALS = range(136, 144)  # major numbers of the devices


class PortSettings(NamedTuple):
    """A port, and how to open it. exclusive: refuse one that another process has locked."""

    port: str
    baud: int
    line: LineSettings
    exclusive: bool = True
    control: ControlLines = USUAL_LINES

    @property
    def is_local(self) -> bool:
        """Whether it is a device of this machine, and no URL."""
        return "://" not in self.port


def open_serial_port(settings: PortSettings, write_timeout_s: float) -> Any:
    """Open anything that pyserial's serial_for_url takes. Raises DriverError."""
    options: dict[str, Any] = {"exclusive": True} if settings.exclusive and settings.is_local else {}
    if not settings.port.startswith("rfc2217://"):  # which refuses to be opened with one
        options["write_timeout"] = write_timeout_s
    opened: Any = None
    try:
        opened = serial.serial_for_url(
            settings.port,
            do_not_open=True,
            baudrate=settings.baud,
            bytesize=settings.line.data_bits,
            parity=_PARITIES[settings.line.parity],
            stopbits=settings.line.stop_bits,
            timeout=POLL_S,
            **options,
        )
        opened.dtr = settings.control.dtr
        opened.rts = settings.control.rts
        opened.open()
    except LINE_EXCEPTIONS as error:
        if opened is not None:
            close_serial_port(opened)
        raise open_error(settings.port, error, settings.line.parity) from error
    if settings.is_local:
        _keep_lines_when_closed(opened)
        if settings.exclusive:
            _keep_others_out(opened)
        with contextlib.suppress(*LINE_EXCEPTIONS):  # ValueError where the device has no such mode
            opened.set_low_latency_mode(True)
    return opened


def let_pass(opened: Any, clock: Clock) -> None:
    """Drop what comes just after opening, until the line is quiet."""
    opened_s = heard_s = now_s = clock.monotonic()
    while now_s - heard_s < _QUIET_GAP_S and now_s - opened_s < _LONGEST_GAP_S:
        came = opened.read(1)
        now_s = clock.monotonic()
        if came:
            heard_s = now_s
            opened.reset_input_buffer()


def await_bytes(opened: Any, seconds: float) -> None:
    """Wait until bytes have come, at most so long, where a port is one that can be waited for; a read of others polls.

    A look every 2 ms was most of what a turn of the daemon cost, where nothing else keeps a processor awake.
    """
    waited_for = getattr(opened, "await_bytes", None)  # a simulated one
    if waited_for is not None:
        waited_for(seconds)
    elif isinstance(opened, serial.Serial) and fcntl is not None and seconds > 0.0:
        select.select([opened.fileno()], [], [], seconds)


def read_port(opened: Any, size: int, exclusive: bool) -> bytes:
    """Bytes of a port; none where it is shared and the other reader took those that had been announced.

    pyserial takes that for a port that is gone. One that is fails in the next write as well.
    """
    try:
        chunk: bytes = opened.read(size)
    except serial.SerialException:
        if exclusive:
            raise
        return b""
    return chunk


def close_serial_port(opened: Any) -> None:
    """Release a port, also one that has vanished. Safe to call twice.

    pyserial leaves the socket of a URL open where it was closed at the far end first: its shutdown fails before.
    """
    sock = getattr(opened, "_socket", None)
    with contextlib.suppress(*LINE_EXCEPTIONS):  # a port that is gone is closed
        opened.close()
    if sock is not None:
        with contextlib.suppress(OSError):
            sock.close()


def _keep_lines_when_closed(opened: Any) -> None:
    """HUPCL off: closing the port drops no line, so that the next opening raises none."""
    with contextlib.suppress(*LINE_EXCEPTIONS):
        attributes = termios.tcgetattr(opened.fileno())
        if attributes[2] & termios.HUPCL:
            attributes[2] &= ~termios.HUPCL
            termios.tcsetattr(opened.fileno(), termios.TCSANOW, attributes)


def _keep_others_out(opened: Any) -> None:
    """TIOCEXCL: a second opening fails, root's aside.

    Not on a pseudo terminal: there the mark outlives this process as long as the far end is open, and would keep out
    whoever comes after one that was killed.
    """
    with contextlib.suppress(*LINE_EXCEPTIONS):
        if os.major(os.fstat(opened.fileno()).st_rdev) not in _PSEUDO_TERMINALS:
            fcntl.ioctl(opened.fileno(), termios.TIOCEXCL)
