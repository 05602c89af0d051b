"""Frames on the bus, and what of them a map's messages hold: numbers in, data bytes out, with counter and checksum.

Which bits are which is cantools' business; numbers here are as they are on the wire, not yet scaled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from rw_ekf.drivers.can.can_file import FrameCare

STANDARD_IDS, EXTENDED_IDS = 0x800, 0x2000_0000
_OVERHEAD_BITS = {False: 47, True: 67}  # of a frame without data or stuff bits, gap included (ISO 11898-1)


class CanFrame(NamedTuple):
    """One frame, and when it came by the host's monotonic clock [s]."""

    id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False
    error: bool = False  # of no node: the controller reports on the bus, as SocketCAN's linux/can/error.h has it
    time_s: float = 0.0

    def lasts_s(self, bitrate: int) -> float:
        """How long it is on the bus [s], without stuff bits."""
        return (_OVERHEAD_BITS[self.extended] + 8 * len(self.data)) / bitrate


def _crc8(polynomial: int) -> Callable[[bytes], int]:
    """A CRC of 8 bits, register FF at the start, inverted at the end."""
    table = []
    for byte in range(256):
        register = byte
        for _ in range(8):
            register = (register << 1) ^ polynomial if register & 0x80 else register << 1
        table.append(register & 0xFF)

    def crc(content: bytes) -> int:
        register = 0xFF
        for byte in content:
            register = table[register ^ byte]
        return register ^ 0xFF

    return crc


def _xor(content: bytes) -> int:
    register = 0
    for byte in content:
        register ^= byte
    return register


# Check values, of b"123456789": 4B, DF, 31, DD.
CHECKSUMS: dict[str, Callable[[bytes], int]] = {
    "crc8-sae-j1850": _crc8(0x1D),
    "crc8-autosar": _crc8(0x2F),
    "xor": _xor,
    "sum": lambda content: sum(content) & 0xFF,
}


class MessageCodec:
    """One message of the database as bytes, with what the map says of its counter and checksum."""

    def __init__(self, message: Any, care: FrameCare) -> None:
        """message: of cantools, with the signals that `care` names."""
        self.name: str = message.name
        self.id: int = message.frame_id
        self.extended: bool = message.is_extended_frame
        self.length: int = message.length
        self._message = message
        self._care = care
        self._alive = message.get_signal_by_name(care.alive) if care.alive is not None else None
        self.alive_span = 1 if self._alive is None else 1 << self._alive.length
        self._sum_at = None if care.checksum is None else message.get_signal_by_name(care.checksum).start // 8

    def pack(self, numbers: Mapping[str, float], alive: int = 0) -> CanFrame:
        """The frame that carries these numbers, and 0 for all others. Raises ValueError if one does not fit."""
        full = {signal.name: 0 for signal in self._message.signals} | dict(numbers)
        if self._alive is not None:
            full[self._alive.name] = alive % self.alive_span
        try:
            data = bytearray(self._message.encode(full, scaling=False, strict=False))
        except Exception as error:  # cantools and bitstruct raise kinds of their own
            raise ValueError(f"message {self.name}: {error}") from error
        if self._sum_at is not None:
            data[self._sum_at] = self._checksum(data)
        return CanFrame(self.id, bytes(data), self.extended)

    def unpack(self, frame: CanFrame) -> tuple[dict[str, float], int | None] | None:
        """Numbers by signal, and the counter; None where length or checksum are wrong."""
        if len(frame.data) != self.length:
            return None
        if self._sum_at is not None and frame.data[self._sum_at] != self._checksum(frame.data):
            return None
        numbers: dict[str, float] = self._message.decode(frame.data, decode_choices=False, scaling=False)
        return numbers, None if self._alive is None else int(numbers[self._alive.name])

    def _checksum(self, data: bytes | bytearray) -> int:
        """Over the bytes but its own, behind those of the id, low one first, where the map says so."""
        assert self._sum_at is not None
        content = bytes(data[: self._sum_at]) + bytes(data[self._sum_at + 1 :])
        if self._care.over_id:
            content = self.id.to_bytes(4 if self.extended else 2, "little") + content
        return CHECKSUMS[self._care.algorithm](content)
