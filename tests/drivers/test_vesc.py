"""VESC: published packets byte for byte, any bytes however they are cut, currents that bear a command out or do not."""

from __future__ import annotations

import struct
from itertools import pairwise
from pathlib import Path

import pytest
import yaml
from crccheck.crc import CrcXmodem
from hypothesis import given
from hypothesis import strategies as st

from rw_ekf.clock import VirtualClock
from rw_ekf.driver import OPPOSITE, ZERO_BY_MODE
from rw_ekf.drivers.line.framing import Frame
from rw_ekf.drivers.line.registers import decode_register
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.drivers.line.vesc import IDENTITY_ID, VALUE_BYTES, VALUES_ID, VescCodec, packed, unpacked
from rw_ekf.drivers.line.vesc_protocol import VescProtocol
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.vesc_server import VescServer
from rw_ekf.drivers.sim.virtual_line import VirtualCable
from rw_ekf.errors import ConfigError
from rw_ekf.units import RAD_S_PER_RPM
from tests.faults.rig import open_timed
from tests.injecting import put_faults
from tests.live.bench import ROOT, protocol_named, virtual_wheel

MASK = 0xC1A1
# Of PyVESC's own tests (packets), and of what every description of the protocol begins with (the version is asked for).
PUBLISHED = [
    (b"Te!", b"\x02\x03Te!B\x92\x03"),
    (b"!\xe1$ ", b"\x02\x04!\xe1$ 8\xbb\x03"),
    (b"\x00", bytes.fromhex("02 01 00 00 00 03")),
]
DAMAGED = [
    b"\x01\x03Te!B\x92\x03",
    b"\x02\x02Te!B\x92\x03",
    b"\x02\x04Te!B\x92\x03\x03",
    b"\x02\x03se!B\x92\x03",
    b"\x02\x03TeyB\x92\x03",
    b"\x02\x03Te!\xaa\x91\x03",
    b"\x02\x03Te!B\x92\x09",
]


@pytest.mark.parametrize(("payload", "packet"), PUBLISHED)
def test_packets_are_the_published_ones(payload: bytes, packet: bytes) -> None:
    """Byte for byte, both ways."""
    assert packed(payload) == packet
    assert unpacked(packet) == ([payload], 0, b"")


@given(st.binary(min_size=1, max_size=255))
def test_the_checksum_is_the_one_of_another_program(payload: bytes) -> None:
    """CRC-16/XMODEM as crccheck has it, whose check value is 31C3, high byte first; no payload is 0 or 256 bytes."""
    assert CrcXmodem.calc(b"123456789") == 0x31C3
    assert packed(payload)[-3:] == CrcXmodem.calc(payload).to_bytes(2, "big") + b"\x03"
    for length in (0, 256):
        with pytest.raises(ValueError, match="1 to 255"):
            packed(bytes(length))


@pytest.mark.parametrize("damaged", DAMAGED)
def test_published_damaged_packets_are_none_and_the_one_behind_them_is_read(damaged: bytes) -> None:
    """PyVESC's list: wrong start, lengths, content, checksum, end."""
    payloads, count, rest = unpacked(damaged + PUBLISHED[1][1] + b"\x05\x09\x01")
    assert payloads == [PUBLISHED[1][0]]
    assert count == damaged.count(b"\x02")  # each such byte may have begun one
    assert rest == b""


@given(
    st.lists(st.one_of(st.binary(max_size=40), st.binary(min_size=1, max_size=60).map(packed)), max_size=6),
    st.lists(st.integers(0, 400), max_size=4),
)
def test_what_comes_out_does_not_depend_on_where_the_bytes_are_cut(pieces: list[bytes], cuts: list[int]) -> None:
    """Noise and packets: the same payloads, the same count of damaged ones, the same rest; no more than one packet."""
    stream = b"".join(pieces)
    whole = unpacked(stream)
    payloads: list[bytes] = []
    damaged, rest = 0, b""
    edges = [0, *sorted(min(cut, len(stream)) for cut in cuts), len(stream)]
    for at, end in pairwise(edges):
        found, count, rest = unpacked(rest + stream[at:end])
        payloads, damaged = payloads + found, damaged + count
        assert len(rest) < 260
    assert (payloads, damaged, rest) == whole


@given(st.binary(max_size=300), st.binary(min_size=1, max_size=60))
def test_a_packet_behind_any_noise_is_read(noise: bytes, payload: bytes) -> None:
    """Whatever length a false beginning announces."""
    assert unpacked(noise + packed(payload))[0][-1:] == [payload]


def test_requests_are_as_the_firmware_reads_them() -> None:
    """Written out from comm/commands.c: 0.1 A in mA, released, values by mask with the seq above it, the version."""
    codec = VescCodec(MASK)
    for wanted, payload in [
        ((9, 6, struct.pack(">i", 100)), "06 00 00 00 64"),
        ((9, 6, struct.pack(">i", -2000)), "06 ff ff f8 30"),
        ((9, 7, struct.pack(">i", 0)), "07 00 00 00 00"),
        ((9, VALUES_ID, b""), "32 09 00 c1 a1"),
        ((9, IDENTITY_ID, b""), "00"),
    ]:
        request = codec.request(*wanted)
        assert request[2:-3] == bytes.fromhex(payload)
        (frame,) = VescCodec(MASK).requests(request).frames
        assert frame[1:] == wanted[1:]


def test_a_reply_is_read_as_the_firmware_writes_it() -> None:
    """Numbers of comm/commands.c for each bit in turn; the wheel's speed is the electrical one by its pole pairs."""
    values = ((0, "h", 345), (5, "i", -123), (7, "i", 42000), (8, "h", 241), (14, "i", 77), (15, "B", 3))
    assert [VALUE_BYTES[bit] for bit, code, _ in values] == [(struct.calcsize(code),) for _, code, _ in values]
    data = b"".join(struct.pack(">" + code, number) for _, code, number in values)
    codec, register = VescCodec(MASK), protocol_named("vesc-wheel").wire_map.speed_register
    (frame,) = codec.replies(packed(bytes.fromhex("32 05 00 c1 a1") + data)).frames
    assert frame == Frame(5, VALUES_ID, data)
    reported = decode_register(register, frame.data)
    assert reported["speed"] == pytest.approx(6000.0 * RAD_S_PER_RPM)
    assert (reported["temperature"], reported["current"], reported["bus_voltage"]) == pytest.approx((34.5, -1.23, 24.1))
    assert reported["flags"] == 3 * 256 + 1
    assert codec.replies(packed(bytes.fromhex("32 05 00 c1 a0") + data)).frames[0].id < 0  # of another mask
    assert codec.replies(packed(b"\x15hello")).frames[0].id < 0  # a text that it prints


def test_who_answers_is_told_by_the_processors_number() -> None:
    """Version 6.05 of a VESC 6 and its 12 bytes; another name or setting is the same one, another number is not."""
    codec = VescCodec(MASK)
    tail = (bytes(range(12)), b"\0\0\0\0")
    reported = [
        codec.replies(packed(b"\x00\x06\x05" + name + b"\0" + number + more)).frames[0].data
        for name, number, more in [(b"60_MK5", *tail), (b"60", tail[0], b"\1\0"), (b"60_MK5", bytes(12), tail[1])]
    ]
    assert reported[0] == reported[1] != reported[2]
    assert reported[0][:2] == b"\x06\x05"
    assert codec.replies(packed(b"\x00\x03\x17")).frames[0].id < 0  # an echo of a request has less than a name
    assert codec.replies(packed(b"\x00\x03\x17410")).frames[0].data[:2] == b"\x03\x17"


class Rig:
    """A wheel on a virtual line, and its driver."""

    def __init__(self, turned: bool = False) -> None:
        """turned: the map has the sign of the current turned where it is told."""
        spoken = protocol_named("vesc-wheel")
        assert isinstance(spoken, VescProtocol)
        plant = PlantRunner(PlantParameters(), PlantNoise(0.0), 1, PlantState(speed_rad_s=50.0))
        self.clock = VirtualClock()
        self.frames: list[Frame] = []
        self.server = VescServer(spoken.wire_map, plant, watch=self.frames.append)
        if turned:
            (values,) = (register for register in spoken.wire_map.registers if register.id == VALUES_ID)
            fields = tuple(
                field.model_copy(update={"scale": -field.scale}) if field.name == "current" else field
                for field in values.fields
            )
            changed = values.model_copy(update={"fields": fields})
            registers = tuple(changed if one is values else one for one in spoken.wire_map.registers)
            spoken = VescProtocol(spoken.wire_map.model_copy(update={"registers": registers}))
        opened = VirtualCable(self.server, self.clock).carrying(spoken).open_wheel("nowhere", self.clock, 0.04)
        assert isinstance(opened, SerialWheel)
        self.wheel = opened

    def writes_A(self) -> list[float]:
        """Currents that came."""
        return [struct.unpack(">i", frame.data)[0] / 1000 for frame in self.frames if frame.id == 6]


def test_a_mean_that_began_before_the_command_does_not_speak_against_it() -> None:
    """Steps of 0.4 and 0.8 A: taken once, two questions behind each, and the next reading has the new one alone."""
    rig = Rig()
    for current_A in (0.4, -0.4, 0.0):
        rig.wheel.read(1.0)
        rig.clock.sleep(0.05)
        wanted = rig.wheel.link.requests
        issued = rig.wheel.command_current(current_A)
        assert (issued.current_A, issued.acknowledged, issued.reason) == (current_A, True, None)
        assert rig.wheel.link.requests - wanted == 3
        rig.clock.sleep(0.08)
        sample = rig.wheel.read(1.0)
        assert sample is not None
        assert sample.current_A == current_A
    assert rig.writes_A() == [0.4, -0.4, 0.0]


@pytest.mark.parametrize(
    ("text", "turned", "reason"),
    [
        ("nack/current_command", False, "not_taken"),
        ("silence", False, "timeout"),
        ("nack-acted/current_command", True, OPPOSITE),
    ],
)
def test_a_command_that_telemetry_does_not_bear_out_is_sent_again_and_not_believed(
    text: str, turned: bool, reason: str
) -> None:
    """Not done, not heard of, told with the other sign: no acknowledgement; twice where telemetry speaks against it."""
    rig = Rig(turned)
    put_faults(rig.server, text)
    began_s = rig.clock.monotonic()
    issued = rig.wheel.command_current(0.3)
    assert (issued.acknowledged, issued.reason) == (False, reason)
    assert rig.clock.monotonic() - began_s < 0.05
    assert rig.writes_A() == ([0.3] if reason == "timeout" else [0.3, 0.3])


def test_a_zero_that_is_not_taken_lets_go_of_the_motor_by_its_other_command() -> None:
    """A brake current of zero; and where the time-out is what lets go, that is seen as well."""
    rig = Rig()
    assert rig.wheel.command_current(0.3).acknowledged
    put_faults(rig.server, "nack/current_command")
    assert rig.wheel.stop_current().reason == ZERO_BY_MODE
    assert rig.server.command_A == 0.0
    put_faults(rig.server, "")
    assert rig.wheel.command_current(0.3).acknowledged
    rig.clock.sleep(1.1)
    rig.wheel.read(1.0)
    put_faults(rig.server, "nack/current_command")
    stopped = rig.wheel.stop_current()
    assert (stopped.current_A, stopped.acknowledged, stopped.reason) == (0.0, True, None)


def test_a_current_that_is_not_repeated_is_let_go_and_reading_does_not_repeat_it() -> None:
    """Its own time-out, a second: asked all the while, the wheel is without current at 1.1 s, and was not at 0.9 s."""
    rig = Rig()
    rig.wheel.command_current(0.3)
    for _ in range(9):
        rig.clock.sleep(0.1)
        rig.wheel.read(1.0)
    assert rig.server.command_A == 0.3
    rig.clock.sleep(0.2)
    rig.wheel.read(1.0)
    assert rig.server.command_A == 0.0


def test_a_fault_of_the_vesc_is_one_of_the_wheel(tmp_path: Path) -> None:
    """Codes by the flags of a simulated one: fault, and over temperature, with the code above them in the status."""
    bench = virtual_wheel(tmp_path, protocol="vesc-wheel")
    wheel = open_timed(bench, "vesc-wheel", 0.04)
    for text, status, stated in (("flag:1", 4 * 256 + 1, {"fault"}), ("heat:101", 5 * 256 + 4, {"over_temperature"})):
        bench.fault(text)
        sample = wheel.read(1.0)
        assert sample is not None
        assert sample.status == status
        assert sample.conditions == stated


@pytest.mark.parametrize("number", ["inf", "-inf", "nan"])
def test_a_speed_that_no_integer_carries_is_none(tmp_path: Path, number: str) -> None:
    """Saturated at an end of 32 bits: damaged, no sample; then as before."""
    bench = virtual_wheel(tmp_path, protocol="vesc-wheel")
    wheel = open_timed(bench, "vesc-wheel", 0.04)
    bench.fault(f"value/cycle:speed={number}")
    assert wheel.read(1.0) is None
    assert wheel.link.damaged == 1
    bench.fault("")
    assert wheel.read(1.0) is not None


def test_a_count_that_wraps_is_no_restart() -> None:
    """From the highest number of 32 bits to the lowest, and on; a fall by less is one, once."""
    rig = Rig()
    full_turns = 2**31 / 6.0
    rig.server._turned_rad = (full_turns - 0.5) * 2.0 * 3.141592653589793
    segments, events = [], []
    for _ in range(8):
        sample = rig.wheel.read(1.0)
        assert sample is not None
        segments.append(sample.segment)
        events.append(sample.news)
        rig.clock.sleep(0.1)
        if len(segments) == 5:
            rig.server.restart()
    assert segments == [0] * 5 + [1] * 3
    assert [news[0] for news in events if news is not None] == ["wheel_restarted"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda content: content["registers"][2].pop("mask"), "mask is required"),
        (lambda content: content["registers"][2].update(mask=0xC1A3), "asks for numbers of 2, 2, 4, 4, 2, 4, 1 bytes"),
        (lambda content: content["registers"][2]["fields"][2].pop("pole_pairs"), "name needs pole_pairs"),
        (lambda content: content["registers"][2]["fields"][1].update(name="other"), "need one named current"),
        (lambda content: content["registers"][0].update(id=8), "is 8 (write); a VESC is asked and commanded by 128"),
    ],
)
def test_a_map_that_a_vesc_does_not_speak_is_refused(tmp_path: Path, change: object, words: str) -> None:
    """With the place and what is wrong there."""
    content = yaml.safe_load((ROOT / "config" / "vesc-wheel.yaml").read_text(encoding="utf-8"))
    change(content)  # type: ignore[operator]
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    with pytest.raises(ConfigError) as raised:
        protocol_named(str(tmp_path / "map.yaml"))
    assert any(words in finding and "map.yaml:" in finding for finding in raised.value.findings)
