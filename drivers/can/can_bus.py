"""A bus as the link sees it, and every bus that python-can opens: `can:socketcan:can0`, `can:virtual:bench`, ...

Frames have the host's monotonic time. python-can stamps them with the hour of the day, which may be set: a stamp says
how long ago a frame came, but never before the bus was last found empty.
"""

from __future__ import annotations

import contextlib
import errno
from typing import Any, NamedTuple, Protocol

from rw_ekf.clock import Clock
from rw_ekf.drivers.can.can_frames import CanFrame
from rw_ekf.errors import DriverError

PREFIX = "can:"
SERIAL_INTERFACE = "slcan"  # the one that is opened as a serial port, not by python-can
MOST_FRAMES = 4_000  # taken at once: a babbling node must not keep us from commanding
_SEND_WITHIN_S = 0.02
_NO_ROOM = (errno.ENOBUFS, errno.EAGAIN)
_UP = 1  # IFF_UP of an interface's flags


class CanPort(NamedTuple):
    """What a port's name says: `can:INTERFACE:CHANNEL[#WHEEL]`; any other name is that of an slcan adapter's tty."""

    interface: str
    channel: str

    @classmethod
    def of(cls, name: str) -> CanPort:
        """Of a name. Raises DriverError where it is none."""
        if not name.startswith(PREFIX):
            return cls(SERIAL_INTERFACE, name)
        interface, colon, channel = name.removeprefix(PREFIX).partition(":")
        if not colon or not interface or not channel:
            raise DriverError(
                f"{name}: is no name of a CAN bus: write can:socketcan:can0, can:slcan:/dev/ttyACM0, or the device of "
                "an slcan adapter"
            )
        return cls(interface, channel if interface == SERIAL_INTERFACE else channel.partition("#")[0])


class CanBus(Protocol):
    """What frames go to and come from. Every method raises DriverError when the bus is lost."""

    stamps_arrival: bool  # whether a frame's time is when it came, and not when it was looked for

    def receive(self, timeout_s: float) -> list[CanFrame]:
        """Take what has come; where that is nothing, wait for it."""
        ...

    def send(self, frame: CanFrame) -> float | None:
        """Send a frame: when it will be on the bus by the host's clock, without its own length; None: no room."""
        ...

    def forget_unsent(self) -> None:
        """Let nothing of what was sent, and has not gone out yet, come at some later time."""
        ...

    def close(self) -> None:
        """Let go of it. Safe to call twice."""
        ...


class PythonCanBus:
    """A bus that python-can opened. A shared one: nobody is kept out."""

    stamps_arrival = True

    def __init__(self, port: CanPort, bitrate: int, clock: Clock) -> None:
        """Open it. Raises DriverError."""
        try:
            import can
        except ImportError as error:
            raise DriverError(
                f"{port.interface}:{port.channel}: what opens a CAN bus is not installed ({error.name or error}): "
                'pip install "rw-ekf[can]"'
            ) from None
        self._name = f"{PREFIX}{port.interface}:{port.channel}"
        self._can = can
        self._clock = clock
        if port.interface == "socketcan":
            _check_up(self._name, port.channel)
        try:
            self._bus: Any = can.Bus(interface=port.interface, channel=port.channel, bitrate=bitrate)
        except Exception as error:  # every interface has kinds of its own
            raise DriverError(f"{self._name} could not be opened: {_stated(error)}. {_HINT}") from error
        self._empty_at_s = clock.monotonic()

    def receive(self, timeout_s: float) -> list[CanFrame]:
        """Frames that have come."""
        found: list[CanFrame] = []
        wait_s = max(timeout_s, 0.0)
        since_s = self._empty_at_s
        try:
            while len(found) < MOST_FRAMES:
                message = self._bus.recv(wait_s)
                if message is None:
                    self._empty_at_s = self._clock.monotonic()
                    break
                found.append(self._frame(message, since_s))
                wait_s = 0.0
        except Exception as error:
            raise self._lost(error) from error
        return found

    def send(self, frame: CanFrame) -> float | None:
        """Send; a queue that stays full is no room, and never waited for long."""
        message = self._can.Message(
            arbitration_id=frame.id,
            data=frame.data,
            is_extended_id=frame.extended,
            is_remote_frame=frame.remote,
            check=False,
        )
        if frame.remote:
            message.dlc = 8
        try:
            self._bus.send(message, timeout=_SEND_WITHIN_S)
        except Exception as error:
            if "buffer full" in str(error) or getattr(error, "error_code", None) in _NO_ROOM:
                return None
            raise self._lost(error) from error
        return self._clock.monotonic()

    def forget_unsent(self) -> None:
        """What is in the kernel's queue stays there: the one that comes last counts."""

    def close(self) -> None:
        """Shut it down."""
        with contextlib.suppress(Exception):  # a bus that is gone is closed
            self._bus.shutdown()

    def _frame(self, message: Any, since_s: float) -> CanFrame:
        now_s = self._clock.monotonic()
        ago_s = self._clock.utc().timestamp() - message.timestamp
        time_s = min(max(now_s - ago_s, since_s), now_s)
        return CanFrame(
            message.arbitration_id,
            bytes(message.data),
            message.is_extended_id,
            message.is_remote_frame,
            message.is_error_frame,
            time_s,
        )

    def _lost(self, error: Exception) -> DriverError:
        return DriverError(
            f"{self._name} failed: {_stated(error)}. The interface is down or its adapter was unplugged; check both"
        )


_HINT = "Check the name, and that the interface is up (ip link show), or try the simulated wheel: rw-ekf simulate"


def _stated(error: Exception) -> str:
    return str(error) or type(error).__name__


def _check_up(name: str, interface: str) -> None:
    """Raise DriverError where an interface is not there or down: it could be bound all the same."""
    try:
        with open(f"/sys/class/net/{interface.replace('/', '')}/flags", encoding="ascii") as file:
            up = int(file.read(), 16) & _UP
    except FileNotFoundError:
        raise DriverError(f"{name}: there is no interface {interface}. {_HINT}") from None
    except (OSError, ValueError):
        return
    if not up:
        raise DriverError(
            f"{name}: the interface is down. Bring it up: sudo ip link set {interface} up type can bitrate 500000 "
            "restart-ms 100"
        )
