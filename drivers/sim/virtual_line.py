"""A simulated wheel behind the real serial driver in this process, on any clock: hours of a faulty line in seconds.

The port is an object with the methods of pyserial that the driver uses. What is on the line comes when the clock says
so, and a read waits on that clock; frames, checksums, stale replies and reconnections are the driver's own.
"""

from __future__ import annotations

import math

import serial

from rw_ekf.clock import Clock
from rw_ekf.drivers.line.line_errors import open_error
from rw_ekf.drivers.line.register_protocol import RegisterProtocol
from rw_ekf.drivers.line.serial_port import POLL_S, PortSettings
from rw_ekf.drivers.sim.register_server import RegisterServer
from rw_ekf.drivers.sim.wheel_line import BusElectronics, WheelLine

IDLE_ADVANCE_S = 0.5


class VirtualPort:
    """The client's end of a line, as pyserial's ports are."""

    def __init__(self, cable: VirtualCable, write_timeout_s: float) -> None:
        """Raise SerialException while the cable is out."""
        self._cable = cable
        self._write_timeout_s = write_timeout_s
        self._waiting = bytearray()
        self._open = True
        cable.check()

    @property
    def in_waiting(self) -> int:
        """How many bytes have come."""
        self._receive()
        return len(self._waiting)

    def read(self, size: int = 1) -> bytes:
        """Up to `size` bytes, as many as come within POLL_S."""
        if len(self._waiting) < size or not self._open:
            self._await(size, POLL_S)
        content = bytes(self._waiting[:size])
        del self._waiting[:size]
        return content

    def await_bytes(self, seconds: float) -> None:
        """Wait until something has come, as long as by looks of POLL_S [s], the last of which is left to a read."""
        self._await(1, POLL_S * (math.ceil(seconds / POLL_S) - 1))

    def write(self, content: bytes) -> int:
        """Send bytes. Raises SerialTimeoutException where the far end takes none."""
        self._receive()
        line, now_s = self._cable.line, self._cable.now_s()
        if not line.takes(now_s):
            self._cable.clock.sleep(self._write_timeout_s)
            raise serial.SerialTimeoutException("Write timeout")
        line.take(bytes(content), now_s)
        return len(content)

    def reset_input_buffer(self) -> None:
        """Forget what has come."""
        self._receive()
        self._waiting.clear()

    def reset_output_buffer(self) -> None:
        """Nothing waits to be sent: the line takes bytes or refuses them."""

    def close(self) -> None:
        """Let go of the line."""
        self._open = False

    def _await(self, size: int, seconds: float) -> None:
        """Let time pass until so many bytes have come, at most so long [s]."""
        clock = self._cable.clock
        end_s = clock.monotonic() + seconds
        while True:
            self._receive()
            left_s = end_s - clock.monotonic()
            if len(self._waiting) >= size or left_s <= 0.0:
                break
            clock.sleep(min(max(self._cable.next_in_s(), 0.0), left_s))

    def _receive(self) -> None:
        if not self._open:
            raise serial.PortNotOpenError
        now_s = self._cable.check()
        self._waiting += self._cable.line.work(now_s)


class VirtualCable:
    """A wheel's line in the time of a clock; ports are opened on it one after the other."""

    def __init__(self, server: RegisterServer | BusElectronics, clock: Clock) -> None:
        self.line = WheelLine(server)
        self.clock = clock
        self._zero_s = clock.monotonic() - server.plant.time_s

    def now_s(self) -> float:
        """The wheel's time [s]."""
        return self.clock.monotonic() - self._zero_s

    def next_in_s(self) -> float:
        """In how long something comes, or the cable is pulled [s]; a moment more, so that it is then past."""
        now_s = self.now_s()
        due_s = self.line.next_s(now_s) - now_s
        return due_s + 1e-9 if math.isfinite(due_s) else due_s

    def check(self) -> float:
        """Let the wheel's time go on; what it is [s]. Raises SerialException while the cable is out."""
        now_s = self.now_s()
        self.line.idle(now_s, IDLE_ADVANCE_S)
        if not self.line.is_plugged(now_s):
            self.line.unplug()
            raise serial.SerialException("device disconnected")
        return now_s

    def carrying(self, spoken: RegisterProtocol) -> RegisterProtocol:
        """The same protocol on this cable, whatever the port's name."""
        return spoken.over(self._open_port)

    def _open_port(self, settings: PortSettings, write_timeout_s: float) -> VirtualPort:
        """Raises DriverError while the cable is out."""
        try:
            return VirtualPort(self, write_timeout_s)
        except serial.SerialException as error:
            raise open_error(settings.port, error, settings.line.parity) from error
