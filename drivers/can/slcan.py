"""A CAN adapter on a serial line, by Lawicel's ASCII commands (slcan): lines out, lines in, frames on both sides.

    tIIIL DD..  a frame: identifier of 3 digits, length, data;  T: identifier of 8 digits;  r, R: remote frames
    C, S6, O    close the channel, set its bit rate, open it

A line ends in CR, and nothing of it is checked: what a damaged line holds, checksums in the frames must find.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import serial

from rw_ekf.clock import Clock
from rw_ekf.drivers.can.can_frames import EXTENDED_IDS, STANDARD_IDS, CanFrame
from rw_ekf.drivers.line.line_errors import LINE_EXCEPTIONS, lost_error
from rw_ekf.drivers.line.serial_port import PortSettings, close_serial_port, let_pass, read_port
from rw_ekf.drivers.line.shared_port import OpenPort
from rw_ekf.errors import DriverError

CR, BELL = b"\r", b"\a"
BIT_RATES = {10_000: 0, 20_000: 1, 50_000: 2, 100_000: 3, 125_000: 4, 250_000: 5, 500_000: 6, 800_000: 7, 1_000_000: 8}
_LONGEST = len("T12345678") + 1 + 16 + 4 + 2  # with an adapter's time stamp; no line is so long
_MOST_BYTES = 1 << 20
_WRITE_WITHIN_S = 0.050
_KINDS = {"t": (3, False, False), "T": (8, True, False), "r": (3, False, True), "R": (8, True, True)}
_ACKNOWLEDGED = ("z", "Z")
_HEX = frozenset("0123456789abcdefABCDEF")


class Lines(NamedTuple):
    """What a stretch of bytes held: frames, other lines, how many damaged ones, and the bytes of an unfinished one."""

    frames: list[CanFrame]
    commands: list[str]
    damaged: int
    rest: bytes


def encode(frame: CanFrame) -> bytes:
    """The line that carries a frame."""
    kind = ("R" if frame.remote else "T") if frame.extended else ("r" if frame.remote else "t")
    digits = 8 if frame.extended else 3
    length = 8 if frame.remote else len(frame.data)
    return f"{kind}{frame.id:0{digits}X}{length:X}{frame.data.hex().upper()}\r".encode("ascii")


def decode(buffer: bytes, time_s: float = 0.0) -> Lines:
    """Lines of `buffer`. Which come out does not depend on where the bytes were cut. Never raises."""
    *texts, rest = buffer.replace(BELL, CR).split(CR)
    frames, commands, damaged = [], [], 0
    for text in texts:
        line = text.decode("latin-1")
        begins = max(map(line.rfind, _KINDS))  # no such letter stands within a frame: what is before one is torn
        if begins > 0 and line[:begins] not in _ACKNOWLEDGED:
            damaged += 1
        line = line[max(begins, 0) :]
        if not line or line in _ACKNOWLEDGED:
            continue
        if line[0] not in _KINDS:
            if len(line) <= _LONGEST and line.isascii() and line.isalnum():
                commands.append(line)
            else:
                damaged += 1
            continue
        frame = _frame(line, time_s)
        if frame is None:
            damaged += 1
        else:
            frames.append(frame)
    if len(rest) > _LONGEST:
        rest, damaged = b"", damaged + 1
    return Lines(frames, commands, damaged, rest)


def _frame(line: str, time_s: float) -> CanFrame | None:
    """The frame of a line; None where it is damaged. Four more digits are an adapter's time stamp."""
    digits, extended, remote = _KINDS[line[0]]
    body = line[1:]
    if len(body) <= digits or not _HEX.issuperset(body):
        return None
    number, length = int(body[:digits], 16), int(body[digits], 16)
    data = body[digits + 1 :]
    size = 0 if remote else 2 * length
    if length > 8 or len(data) not in (size, size + 4) or number >= (EXTENDED_IDS if extended else STANDARD_IDS):
        return None
    return CanFrame(number, bytes.fromhex(data[:size]), extended, remote, False, time_s)


class SlcanBus:
    """A bus behind such an adapter; its port is opened as any serial wheel's. Raises DriverError when it is lost."""

    stamps_arrival = False

    def __init__(self, settings: PortSettings, bitrate: int, clock: Clock, open_port: OpenPort) -> None:
        """Open port and channel. Beside another process (not exclusive) the channel is taken as it is."""
        if bitrate not in BIT_RATES:
            rates = ", ".join(map(str, BIT_RATES))
            raise DriverError(f"{settings.port}: an slcan adapter has no bit rate of {bitrate}; it has: {rates}")
        self.settings = settings
        self.damaged = 0
        self._torn = False  # the beginning of a line may have gone out without its end
        self.received_bytes = 0
        self._clock = clock
        self._rest = b""
        self._byte_s = settings.line.bits_per_byte / settings.baud
        self._serial: Any = open_port(settings, _WRITE_WITHIN_S)
        try:
            if settings.exclusive:
                self._serial.write(CR + b"C" + CR)
                let_pass(self._serial, clock)
                self._serial.write(b"S%d" % BIT_RATES[bitrate] + CR)
            self._serial.write(b"O" + CR)
        except serial.SerialTimeoutException:
            pass  # the far end takes nothing yet: that is silence, and no lost port
        except LINE_EXCEPTIONS as error:
            self.close()
            raise lost_error(settings.port, error) from error

    def receive(self, timeout_s: float) -> list[CanFrame]:
        """Frames that have come."""
        end_s = self._clock.monotonic() + timeout_s
        while True:
            try:
                chunk = self._read(self._serial.in_waiting or 1 if timeout_s > 0.0 else self._serial.in_waiting)
            except LINE_EXCEPTIONS as error:
                raise lost_error(self.settings.port, error) from error
            now_s = self._clock.monotonic()
            self.received_bytes += len(chunk)
            found = decode(self._rest + chunk, now_s)
            self._rest = found.rest
            self.damaged += found.damaged + len(found.commands)
            if found.frames or now_s >= end_s:
                return found.frames

    def send(self, frame: CanFrame) -> float | None:
        """Write a frame's line; None where the far end takes no bytes: then nothing of it may come later."""
        line = CR + encode(frame) if self._torn else encode(frame)
        started_s = self._clock.monotonic()
        try:
            self._serial.write(line)
        except serial.SerialTimeoutException:
            self.forget_unsent()
            return None
        except LINE_EXCEPTIONS as error:
            raise lost_error(self.settings.port, error) from error
        self._torn = False
        return started_s + len(line) * self._byte_s

    def forget_unsent(self) -> None:
        """Drop what the far end has not taken."""
        self._torn = True
        if self.settings.is_local:
            try:
                self._serial.reset_output_buffer()
            except LINE_EXCEPTIONS as error:
                raise lost_error(self.settings.port, error) from error

    def close(self) -> None:
        """Release the port; the channel stays open, for whoever shares it."""
        close_serial_port(self._serial)

    def _read(self, size: int) -> bytes:
        """What has come, and no more than a buffer full of it; `size` may be 0."""
        if size <= 0:
            return b""
        return read_port(self._serial, min(size, _MOST_BYTES), self.settings.exclusive)
