"""Frames on the line: bytes in, bytes out, no port in sight.

    frame   1F 7F  body  1F FF      a 1F inside the body is sent twice; anything between frames is skipped
    body    seq u8, id u8, data, crc16 (low byte first, over seq, id and data)

Where the wire map gives the wheel an address, that is one more byte before seq, in requests and replies, checksum too.

The marker bytes come from the wire map. `decode` never raises, whatever the bytes: noise on a line is not exceptional.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from rw_ekf.drivers.line.wire_layout import Framing

MAX_DATA_BYTES = 256
_OVERHEAD_BYTES = 4  # seq, id, crc
_MAX_ENCODED_BYTES = 2 + 2 * (MAX_DATA_BYTES + _OVERHEAD_BYTES) + 2  # without an address


class Crc(NamedTuple):
    """A reflected 16-bit CRC: polynomial (reflected), register at the start, final exclusive or."""

    polynomial: int
    start: int
    final: int


# Check values, of b"123456789": 6F91, 906E, 2189, 4B37.
CRCS: dict[str, Crc] = {
    "crc16-mcrf4xx": Crc(0x8408, 0xFFFF, 0x0000),
    "crc16-x25": Crc(0x8408, 0xFFFF, 0xFFFF),
    "crc16-kermit": Crc(0x8408, 0x0000, 0x0000),
    "crc16-modbus": Crc(0xA001, 0xFFFF, 0x0000),
}


def _table(polynomial: int) -> tuple[int, ...]:
    """Remainders of the 256 possible low bytes."""
    remainders = []
    for remainder in range(256):
        for _ in range(8):
            remainder = (remainder >> 1) ^ polynomial if remainder & 1 else remainder >> 1  # noqa: PLW2901
        remainders.append(remainder)
    return tuple(remainders)


_TABLES = {polynomial: _table(polynomial) for polynomial in {crc.polynomial for crc in CRCS.values()}}


def crc16(content: bytes, name: str = "crc16-mcrf4xx") -> int:
    """The checksum of `content` under one of CRCS."""
    algorithm = CRCS[name]
    table = _TABLES[algorithm.polynomial]
    register = algorithm.start
    for byte in content:
        register = (register >> 8) ^ table[(register ^ byte) & 0xFF]
    return register ^ algorithm.final


class Frame(NamedTuple):
    """One good frame."""

    seq: int
    id: int
    data: bytes


NOT_OURS = Frame(-1, -1, b"")  # good, and of no use: of another wheel on the line


class Decoded(NamedTuple):
    """What a stretch of bytes held: whole good frames, how many damaged ones, and the bytes of an unfinished one."""

    frames: tuple[Frame, ...]
    damaged: int
    rest: bytes


def encode(seq: int, register_id: int, data: bytes = b"", framing: Framing | None = None) -> bytes:
    """The frame that carries `data` (at most 256 bytes). Raises ValueError if it does not fit into one."""
    framing = framing or Framing()
    if len(data) > MAX_DATA_BYTES:
        raise ValueError(f"a frame carries at most {MAX_DATA_BYTES} data bytes, not {len(data)}")
    content = _address(framing) + bytes((seq & 0xFF, register_id)) + data
    body = content + crc16(content, framing.crc).to_bytes(2, "little")
    escape = bytes((framing.escape,))
    doubled = body.replace(escape, escape + escape)
    return escape + bytes((framing.start,)) + doubled + escape + bytes((framing.end,))


def decode(buffer: bytes, framing: Framing | None = None) -> Decoded:
    """Take every frame out of `buffer`; feed `rest` in front of the next bytes.

    Which frames come out does not depend on where the bytes were cut, and `rest` never exceeds one frame. After a
    damaged frame the search continues just behind its start, so that a good frame behind a torn one is still found.
    """
    framing = framing or Framing()
    start = bytes((framing.escape, framing.start))
    frames: list[Frame] = []
    damaged = 0
    position = 0
    while True:
        found = buffer.find(start, position)
        if found < 0:
            # a lone escape at the very end may be the first half of a start
            rest = buffer[-1:] if len(buffer) > position and buffer[-1] == framing.escape else b""
            return Decoded(tuple(frames), damaged, rest)
        body, end, finished = _body(buffer, found + 2, framing)
        if not finished:
            return Decoded(tuple(frames), damaged, buffer[found:])
        frame = _frame(body, framing) if body is not None else None
        if frame is None:
            damaged += 1
            position = found + 2
        else:
            frames.append(frame)
            position = end


class Codec(Protocol):
    """Requests and replies as bytes, at either end of a line: what families of wheels differ in."""

    overhead_bytes: int  # of a frame around its data, escapes aside

    def request(self, seq: int, register_id: int, data: bytes) -> bytes:
        """The frame of a request. Raises ValueError if it does not fit into one."""
        ...

    def replies(self, buffer: bytes) -> Decoded:
        """Frames of what came back, of the seq and id that the last request had where they answer it."""
        ...

    def requests(self, buffer: bytes) -> Decoded:
        """Frames at the wheel's end."""
        ...

    def reply(self, answer: Frame) -> bytes:
        """The frame that answers; a write's data is its status."""
        ...


class RegisterCodec:
    """The frames above, the same in both directions."""

    def __init__(self, framing: Framing) -> None:
        self.overhead_bytes = 8 + len(_address(framing))
        self._framing = framing

    def request(self, seq: int, register_id: int, data: bytes) -> bytes:
        """`encode`."""
        return encode(seq, register_id, data, self._framing)

    def replies(self, buffer: bytes) -> Decoded:
        """`decode`."""
        return decode(buffer, self._framing)

    requests = replies

    def reply(self, answer: Frame) -> bytes:
        """`encode`."""
        return encode(*answer, self._framing)


def _address(framing: Framing) -> bytes:
    return b"" if framing.address is None else bytes((framing.address,))


def _body(buffer: bytes, position: int, framing: Framing) -> tuple[bytes | None, int, bool]:
    """The body from `position` with doubled escapes undone, where it ends, and whether that (or a fault) was seen."""
    limit = position + _MAX_ENCODED_BYTES - 2 + 2 * len(_address(framing))  # the start is behind us
    parts = bytearray()
    while True:
        escape = buffer.find(framing.escape, position, limit)
        if escape < 0:
            return None, position, len(buffer) >= limit
        if escape + 1 >= len(buffer):
            return None, position, False
        parts += buffer[position:escape]
        mark = buffer[escape + 1]
        if mark == framing.end:
            return bytes(parts), escape + 2, True
        if mark != framing.escape:
            return None, escape, True  # a new start, or a byte that may not follow an escape: this frame is torn
        parts.append(framing.escape)
        position = escape + 2


def _frame(body: bytes, framing: Framing) -> Frame | None:
    """The frame of a body, or None if it is too short or its checksum does not hold."""
    address = _address(framing)
    least = len(address) + _OVERHEAD_BYTES
    if len(body) < least or crc16(body[:-2], framing.crc) != int.from_bytes(body[-2:], "little"):
        return None
    if not body.startswith(address):
        return NOT_OURS
    body = body[len(address) :]
    return Frame(body[0], body[1], body[2:-2])
