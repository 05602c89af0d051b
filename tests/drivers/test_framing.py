"""Framing: golden bytes, and properties over any bytes."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rw_ekf.drivers.line.framing import MAX_DATA_BYTES, Frame, crc16, decode, encode

frames = st.builds(Frame, st.integers(0, 255), st.integers(0, 255), st.binary(max_size=24))
# noise rich in the bytes that mean something
noise = st.lists(
    st.sampled_from([b"\x1f", b"\x7f", b"\xff", b"\x00", b"\x1f\x7f", b"\x1f\xff", b"a"]), max_size=30
).map(b"".join)


@pytest.mark.parametrize(
    ("name", "check"),
    [("crc16-mcrf4xx", 0x6F91), ("crc16-x25", 0x906E), ("crc16-kermit", 0x2189), ("crc16-modbus", 0x4B37)],
)
def test_crc_has_its_published_check_value(name: str, check: int) -> None:
    """Each checksum of "123456789" is the one in the catalogue of CRCs."""
    assert crc16(b"123456789", name) == check


def test_golden_cycle_request() -> None:
    """The request for register 137 with seq 5 is these bytes, for ever."""
    assert encode(5, 137).hex(" ") == "1f 7f 05 89 c9 97 1f ff"


def test_golden_escape_is_doubled() -> None:
    """A 1F in seq, data or CRC goes out twice, and 100 mA (03E8) little-endian."""
    assert encode(0x1F, 3, bytes((0xE8, 0x03))).startswith(bytes.fromhex("1f7f 1f1f 03 e803"))
    assert decode(encode(0x1F, 0x1F, b"\x1f\x1f")).frames == (Frame(0x1F, 0x1F, b"\x1f\x1f"),)


def test_too_much_data_is_refused() -> None:
    """A frame carries at most MAX_DATA_BYTES, and the message says so."""
    assert decode(encode(1, 2, b"\x1f" * MAX_DATA_BYTES)).frames[0].data == b"\x1f" * MAX_DATA_BYTES
    with pytest.raises(ValueError, match="at most 256 data bytes, not 257"):
        encode(1, 2, bytes(257))


@given(st.lists(frames, max_size=5), noise, noise)
def test_frames_come_back_through_any_noise(sent: list[Frame], before: bytes, between: bytes) -> None:
    """Whatever stands in front of and between frames, every frame comes out, in order."""
    line = before + b"".join(encode(*frame) + between for frame in sent)
    received = decode(line).frames
    assert [frame for frame in received if frame in sent] == sent


@given(st.lists(st.one_of(frames.map(lambda frame: encode(*frame)), noise), max_size=6), st.data())
def test_where_the_bytes_are_cut_does_not_matter(parts: list[bytes], data: st.DataObject) -> None:
    """Fed in pieces cut anywhere, the decoder gives the same frames and the same count of damaged ones."""
    line = b"".join(parts)
    whole = decode(line)
    received: list[Frame] = []
    rest, damaged = b"", 0
    position = 0
    while position < len(line):
        size = data.draw(st.integers(1, 7))
        piece = decode(rest + line[position : position + size])
        received += piece.frames
        damaged += piece.damaged
        rest = piece.rest
        position += size
    assert (tuple(received), damaged, rest) == (whole.frames, whole.damaged, whole.rest)


@given(frames, st.data())
def test_a_wrong_bit_never_passes(frame: Frame, data: st.DataObject) -> None:
    """One flipped bit anywhere in a frame: nothing comes out but, at most, what was sent; never another frame."""
    line = bytearray(encode(*frame))
    position = data.draw(st.integers(0, len(line) - 1))
    line[position] ^= 1 << data.draw(st.integers(0, 7))
    assert all(received == frame for received in decode(bytes(line)).frames)


@given(frames, frames, st.data())
def test_a_good_frame_behind_a_torn_one_is_found(torn: Frame, good: Frame, data: st.DataObject) -> None:
    """However much of a frame is missing, the next one decodes."""
    line = encode(*torn)
    kept = line[: data.draw(st.integers(0, len(line) - 1))]
    assert good in decode(kept + encode(*good)).frames


@settings(max_examples=200)
@given(st.binary(max_size=300))
def test_no_bytes_raise_and_the_rest_is_bounded(line: bytes) -> None:
    """Any bytes decode without an exception."""
    decoded = decode(line)
    assert len(decoded.rest) <= len(line)


def test_a_start_without_an_end_does_not_grow_for_ever() -> None:
    """A start followed by endless bytes is given up once no frame can be that long."""
    rest, damaged = b"\x1f\x7f", 0
    for _ in range(100):
        decoded = decode(rest + b"x" * 100)
        rest, damaged = decoded.rest, damaged + decoded.damaged
        assert len(rest) < 1000
    assert damaged == 1
    assert decode(rest + encode(1, 2)).frames == (Frame(1, 2, b""),)
