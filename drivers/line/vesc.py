"""Packets of a VESC, after its public firmware (vedderb/bldc: comm/packet.c, comm/commands.c, datatypes.h).

    packet   02, length u8, payload, crc16 (CRC-16/XMODEM over the payload, high byte first), 03
    payload  command u8, data; numbers have their high byte first
    00       COMM_FW_VERSION: version (two bytes), name and a zero byte, number of the processor (12 bytes), more
    06, 07   COMM_SET_CURRENT, COMM_SET_CURRENT_BRAKE: a current as i32 in mA; nothing answers
    32       COMM_GET_VALUES_SELECTIVE: mask u32, whose bits request numbers; the reply has the mask and those, in order

Registers above have an id and data: an id that writes is its command, one that reads is 128 and its command. The
firmware sends a mask back as it came and knows nothing of its highest eight bits: a request's seq stands there, by
which a late reply is distinguished from the next one.
"""

from __future__ import annotations

import zlib
from binascii import crc_hqx

from rw_ekf.drivers.line.framing import NOT_OURS, Decoded, Frame

START, END = 0x02, 0x03
FW_VERSION, SET_CURRENT, SET_CURRENT_BRAKE, GET_VALUES_SELECTIVE = 0, 6, 7, 50
FIRST_READ = 128
IDENTITY_ID, VALUES_ID = FIRST_READ + FW_VERSION, FIRST_READ + GET_VALUES_SELECTIVE
# Bytes of the numbers that each bit of a mask requests, from the lowest.
_BYTES_BY_BIT = "2 2 4 4 4 4 2 4 2 4 4 4 4 4 4 1 4 1 2+2+2 4 4 1"
VALUE_BYTES = tuple(tuple(map(int, sizes.split("+"))) for sizes in _BYTES_BY_BIT.split())
_SEQ_SHIFT, _MASK_BITS = 24, 0xFF_FFFF
_AROUND_BYTES = 5  # start, length, checksum, end
_MASK_BYTES, _VERSION_BYTES, _UUID_BYTES = 4, 2, 12


def packed(payload: bytes) -> bytes:
    """The packet of a payload. Raises ValueError if it does not fit into a short one."""
    if not 0 < len(payload) < 256:
        raise ValueError(f"a packet carries 1 to 255 bytes, not {len(payload)}")
    return bytes((START, len(payload))) + payload + crc_hqx(payload, 0).to_bytes(2, "big") + bytes((END,))


def unpacked(buffer: bytes) -> tuple[list[bytes], int, bytes]:
    """Payloads of `buffer`, how many beginnings were no packet, and the bytes from one that is not finished on.

    A good packet counts when its end comes, though a false beginning before it announces a longer one. Which payloads
    come out does not depend on where the bytes were cut, and the rest never exceeds one packet. Never raises.
    """
    starts = [at for at, byte in enumerate(buffer) if byte == START]
    ends = {at: at + _AROUND_BYTES + buffer[at + 1] for at in starts if at + 1 < len(buffer)}
    good = sorted((end, at) for at, end in ends.items() if _is_packet(buffer[at:end]) and end <= len(buffer))
    payloads: list[bytes] = []
    inside: set[int] = set()
    position = 0
    for end, at in good:
        if at >= position:
            payloads.append(buffer[at + 2 : end - 3])
            inside.update(range(at, end))
            position = end
    unfinished = (at for at in starts if at >= position and ends.get(at, len(buffer) + 1) > len(buffer))
    cut = next(unfinished, len(buffer))
    return payloads, sum(at < cut and at not in inside for at in starts), buffer[cut:]


def _is_packet(content: bytes) -> bool:
    """Whether bytes from a beginning to where its length says are one."""
    if len(content) <= _AROUND_BYTES or content[-1] != END:
        return False
    return crc_hqx(content[2:-3], 0) == int.from_bytes(content[-3:-1], "big")


class VescCodec:
    """One end of a line. Made for one line: a reply that states who answers does not say which request it answers."""

    overhead_bytes = _AROUND_BYTES + 1 + _MASK_BYTES

    def __init__(self, mask: int) -> None:
        """mask: of the values that are requested."""
        self._mask = mask
        self._seq = 0

    def request(self, seq: int, register_id: int, data: bytes) -> bytes:
        """The packet of a request or a command. Raises ValueError if it does not fit into one."""
        self._seq = seq
        if register_id < FIRST_READ:
            return packed(bytes((register_id,)) + data)
        return packed(bytes((register_id - FIRST_READ,)) + (b"" if register_id == IDENTITY_ID else self._masked(seq)))

    def replies(self, buffer: bytes) -> Decoded:
        """Frames of what came back; one that answers the last request has its seq and id."""
        payloads, damaged, rest = unpacked(buffer)
        return Decoded(tuple(map(self._replied, payloads)), damaged, rest)

    def _replied(self, payload: bytes) -> Frame:
        command, data = payload[0], payload[1:]
        if command == FW_VERSION and len(data) > _VERSION_BYTES:
            _, _, behind = data[_VERSION_BYTES:].partition(b"\0")
            who = behind[:_UUID_BYTES] or data[_VERSION_BYTES:]  # an old firmware reports its name alone
            return Frame(self._seq, IDENTITY_ID, data[:_VERSION_BYTES] + zlib.crc32(who).to_bytes(4, "big"))
        return self._of_values(command, data) or NOT_OURS

    def requests(self, buffer: bytes) -> Decoded:
        """Frames at the wheel's end: those that it does something about."""
        payloads, damaged, rest = unpacked(buffer)
        frames = (self._requested(payload[0], payload[1:]) for payload in payloads)
        return Decoded(tuple(frame for frame in frames if frame is not None), damaged, rest)

    def _requested(self, command: int, data: bytes) -> Frame | None:
        if command == FW_VERSION:
            return Frame(0, IDENTITY_ID, data)
        if command == GET_VALUES_SELECTIVE:
            return self._of_values(command, data)
        return Frame(0, command, data) if command < FIRST_READ else None

    def reply(self, answer: Frame) -> bytes:
        """The packet that answers; none to a write."""
        seq, register_id, data = answer
        if register_id < FIRST_READ:
            return b""
        if register_id != IDENTITY_ID:
            return packed(bytes((register_id - FIRST_READ,)) + self._masked(seq) + data)
        version, serial = data[:_VERSION_BYTES], data[_VERSION_BYTES:]
        return packed(bytes((FW_VERSION,)) + version + b"rw-ekf\0" + serial.rjust(_UUID_BYTES, b"\0") + bytes(4))

    def _masked(self, seq: int) -> bytes:
        return ((seq & 0xFF) << _SEQ_SHIFT | self._mask).to_bytes(_MASK_BYTES, "big")

    def _of_values(self, command: int, data: bytes) -> Frame | None:
        """The frame of values, or of a request for them; None where it is of others."""
        wanted = int.from_bytes(data[:_MASK_BYTES], "big")
        if command != GET_VALUES_SELECTIVE or len(data) < _MASK_BYTES or wanted & _MASK_BITS != self._mask:
            return None
        return Frame(wanted >> _SEQ_SHIFT, VALUES_ID, data[_MASK_BYTES:])
