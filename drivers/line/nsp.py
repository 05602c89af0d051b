"""NSP, the Nanosatellite Protocol of several families of reaction wheels, after its public implementations.

    frame    C0 packet C0: SLIP (RFC 1055), C0 inside is DB DC, DB inside is DB DD; there is no length
    packet   destination u8, source u8, control u8, data, crc16 (CRC-16/MCRF4XX over all before it, low byte first)
    control  bit 7 poll in a request, final in a reply; bit 6 B, copied from request to reply; bit 5 ack in a reply;
             bits 4 to 0 the command

Registers above have an id and data: ids from 128 on read file id - 128 (07), ids below write mode id (08); PING (00)
and INIT (01) have ids of their own. B is the lowest bit of a request's seq: it tells a late reply from the next one.
"""

from __future__ import annotations

import zlib
from typing import NamedTuple

from rw_ekf.drivers.line.framing import MAX_DATA_BYTES, NOT_OURS, Decoded, Frame, crc16

END, ESCAPE, ESCAPED_END, ESCAPED_ESCAPE = 0xC0, 0xDB, 0xDC, 0xDD
POLL = FINAL = 0x80
B, ACK, COMMAND = 0x40, 0x20, 0x1F
PING, INIT, READ, WRITE = 0x00, 0x01, 0x07, 0x08
FIRST_READ, PING_ID, INIT_ID = 128, 255, 127
OK, REFUSED = b"\x00", b"\x04"  # what the ack of a write reports
_LEAST_BYTES = 5  # destination, source, control, crc
_MOST_BYTES = 2 * (MAX_DATA_BYTES + _LEAST_BYTES)  # escaped


class Packet(NamedTuple):
    """What a good frame holds."""

    destination: int
    source: int
    control: int
    data: bytes


def packed(packet: Packet) -> bytes:
    """The frame of a packet. Raises ValueError if it is too long."""
    if len(packet.data) > MAX_DATA_BYTES:
        raise ValueError(f"a frame carries at most {MAX_DATA_BYTES} data bytes, not {len(packet.data)}")
    content = bytes(packet[:3]) + packet.data
    content += crc16(content).to_bytes(2, "little")
    content = content.replace(bytes((ESCAPE,)), bytes((ESCAPE, ESCAPED_ESCAPE)))
    return bytes((END,)) + content.replace(bytes((END,)), bytes((ESCAPE, ESCAPED_END))) + bytes((END,))


def unpacked(buffer: bytes) -> tuple[list[Packet], int, bytes]:
    """Good packets of `buffer`, how many were damaged, and the bytes behind the last end, of a frame not finished.

    Which packets come out does not depend on where the bytes were cut. Never raises.
    """
    *candidates, rest = buffer.split(bytes((END,)))
    found = [_packet(candidate) for candidate in candidates if candidate]
    damaged = found.count(None)
    if len(rest) > _MOST_BYTES:  # no frame is so long: it is noise, and its end will be taken for a beginning
        rest, damaged = b"", damaged + 1
    return [packet for packet in found if packet is not None], damaged, rest


def _packet(content: bytes) -> Packet | None:
    """The packet between two ends; None where an escape is unknown, bytes are missing, or the checksum is wrong."""
    first, *behind_escapes = content.split(bytes((ESCAPE,)))
    plain = first
    for piece in behind_escapes:
        if not piece or piece[0] not in (ESCAPED_END, ESCAPED_ESCAPE):
            return None
        plain += bytes((END if piece[0] == ESCAPED_END else ESCAPE,)) + piece[1:]
    if len(plain) < _LEAST_BYTES or crc16(plain[:-2]) != int.from_bytes(plain[-2:], "little"):
        return None
    return Packet(plain[0], plain[1], plain[2], plain[3:-2])


class NspCodec:
    """NSP at one end of a line. Made for one line: it remembers each request, for a reply does not say all of it."""

    overhead_bytes = 8  # two ends, packet without data but the number of a file, which a reply repeats

    def __init__(self, wheel: int, own: int, echoes_b: bool | None = None) -> None:
        """Addresses of the wheel and of this program. echoes_b: whether B is copied; None: seen from the replies."""
        self._wheel, self._own = wheel, own
        self.echoes_b = echoes_b
        self.refused_to_read = False  # the last request, though the line works: so does a boot loader
        self._wanted = (0, -1)

    def request(self, seq: int, register_id: int, data: bytes) -> bytes:
        """The frame of a request, to be answered. Raises ValueError if it does not fit into one."""
        self._wanted = (seq, register_id)
        self.refused_to_read = False
        control = POLL | (B if seq & 1 else 0)
        if register_id in (PING_ID, INIT_ID):
            control |= PING if register_id == PING_ID else INIT
        elif register_id >= FIRST_READ:
            control, data = control | READ, bytes((register_id - FIRST_READ,))
        else:
            control, data = control | WRITE, bytes((0, register_id)) + data
        return packed(Packet(self._wheel, self._own, control, data))

    def replies(self, buffer: bytes) -> Decoded:
        """Frames of what came back; one that answers the last request has its seq and id."""
        packets, damaged, rest = unpacked(buffer)
        return Decoded(tuple(map(self._replied, packets)), damaged, rest)

    def _replied(self, packet: Packet) -> Frame:
        seq, register_id = self._wanted
        if packet[:2] != (self._own, self._wheel) or not packet.control & FINAL:
            return NOT_OURS
        copied = bool(packet.control & B)
        if self.echoes_b is None and seq & 1:
            self.echoes_b = copied
        if self.echoes_b is not False and copied != bool(seq & 1):
            return NOT_OURS
        command, data, acked = packet.control & COMMAND, packet.data, bool(packet.control & ACK)
        if command == READ:
            if not acked:
                self.refused_to_read = FIRST_READ <= register_id < PING_ID
                return NOT_OURS
            return Frame(seq, FIRST_READ + data[0], data[1:]) if data else NOT_OURS
        if command == PING and acked:
            return Frame(seq, PING_ID, zlib.crc32(data).to_bytes(4, "little"))  # another wheel's text is another
        status = OK if acked else REFUSED
        if command == INIT:
            return Frame(seq, INIT_ID, status)
        of_this = command == WRITE and register_id < INIT_ID and (len(data) < 2 or data[1] == register_id)
        return Frame(seq, register_id, status) if of_this else NOT_OURS

    def requests(self, buffer: bytes) -> Decoded:
        """Frames at the wheel's end: those that are for it, and to be answered."""
        packets, damaged, rest = unpacked(buffer)
        frames = [self._requested(packet) for packet in packets if packet.destination == self._wheel]
        return Decoded(tuple(frame for frame in frames if frame is not None), damaged, rest)

    def _requested(self, packet: Packet) -> Frame | None:
        if not packet.control & POLL:
            return None
        seq, command, data = int(bool(packet.control & B)), packet.control & COMMAND, packet.data
        if command == READ and len(data) == 1:
            return Frame(seq, FIRST_READ + (data[0] & 0x7F), b"")
        if command == WRITE and len(data) > 1 and data[0] == 0 and data[1] < INIT_ID:
            return Frame(seq, data[1], data[2:])
        return Frame(seq, PING_ID if command == PING else INIT_ID, data) if command in (PING, INIT) else None

    def reply(self, answer: Frame) -> bytes:
        """The frame that answers. A read without data is refused; a write's data is its status, and so is INIT's."""
        seq, register_id, data = answer
        acked, command = bool(data), READ
        if register_id == PING_ID:
            command = PING
        elif register_id < FIRST_READ:
            command, acked, data = (INIT if register_id == INIT_ID else WRITE), data == OK, b""
        elif acked:
            data = bytes((register_id - FIRST_READ,)) + data
        control = FINAL | (B if seq & 1 else 0) | (ACK if acked else 0) | command
        return packed(Packet(self._own, self._wheel, control, data))
