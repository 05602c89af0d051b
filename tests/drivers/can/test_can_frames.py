"""Messages as bytes: checksums by their published values, packing held against struct, and spoilt frames refused."""

from __future__ import annotations

import struct

import pytest

from rw_ekf.drivers.can.can_frames import CHECKSUMS, CanFrame, MessageCodec
from rw_ekf.drivers.can.can_protocol import CanMap
from tests.live.bench import protocol_named

pytest.importorskip("cantools")


@pytest.mark.parametrize(
    ("name", "value"), [("crc8-sae-j1850", 0x4B), ("crc8-autosar", 0xDF), ("xor", 0x31), ("sum", 0xDD)]
)
def test_a_checksum_has_its_published_check_value(name: str, value: int) -> None:
    """Of "123456789": the catalogue of CRC algorithms (CRC-8/SAE-J1850, CRC-8/AUTOSAR); the others by hand."""
    assert CHECKSUMS[name](b"123456789") == value


def codec(message: str) -> MessageCodec:
    """A message of the shipped map."""
    wire_map = protocol_named("can-wheel").wire_map
    assert isinstance(wire_map, CanMap)
    return wire_map.layout.codecs[message]


def test_a_message_is_laid_out_as_its_dbc_says() -> None:
    """Motion of the shipped map against struct: three little-endian words, count, checksum over id and bytes."""
    frame = codec("Motion").pack({"Speed": -400, "Current": 1000, "CurrentCommand": -1}, 0x1FE)
    body = struct.pack("<hhhB", -400, 1000, -1, 0xFE)
    assert frame == CanFrame(0x181, body + bytes((CHECKSUMS["crc8-sae-j1850"](b"\x81\x01" + body),)))
    unpacked = codec("Motion").unpack(frame)
    assert unpacked is not None
    numbers, alive = unpacked
    assert (numbers["Speed"], numbers["Current"], numbers["CurrentCommand"], alive) == (-400, 1000, -1, 0xFE)


def test_no_single_wrong_bit_passes() -> None:
    """Of the 64 bits of a frame each one that is turned is found, and so are 7 and 0 bytes."""
    message = codec("Motion")
    frame = message.pack({"Speed": 123}, 5)
    for bit in range(64):
        data = bytearray(frame.data)
        data[bit // 8] ^= 1 << bit % 8
        assert message.unpack(frame._replace(data=bytes(data))) is None
    assert message.unpack(frame._replace(data=frame.data[:7])) is None
    assert message.unpack(frame._replace(data=b"")) is None


def test_a_number_that_does_not_fit_is_refused() -> None:
    """No current goes out that the signal cannot carry."""
    with pytest.raises(ValueError, match="Command"):
        codec("Command").pack({"Current": 40_000})
