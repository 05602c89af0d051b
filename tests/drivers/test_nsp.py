"""NSP: published frames byte for byte, SLIP for any bytes, a boot loader that has to be left, and replies that lie."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rw_ekf.clock import VirtualClock
from rw_ekf.drivers.line.framing import Frame, crc16
from rw_ekf.drivers.line.nsp import FIRST_READ, INIT_ID, PING_ID, NspCodec, Packet, packed, unpacked
from rw_ekf.drivers.line.nsp_protocol import NspProtocol
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.drivers.sim.faults import FaultInjector
from rw_ekf.drivers.sim.nsp_server import NspServer
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.virtual_line import VirtualCable
from rw_ekf.errors import DriverError
from tests.injecting import put_faults
from tests.live.bench import protocol_named

WHEEL, OWN = 0x33, 0x11
# Of several public implementations of the protocol: (seq, id, data) and the frame.
REQUESTS = [
    ((0, PING_ID, b""), "c0 33 11 80 b8 58 c0"),
    ((0, INIT_ID, struct.pack("<I", 0x1000)), "c0 33 11 81 00 10 00 00 b4 4f c0"),
    ((0, 0x02, struct.pack("<f", 0.1)), "c0 33 11 88 00 02 cd cc cc 3d 0f 92 c0"),
    ((0, 0x02, struct.pack("<f", 0.0)), "c0 33 11 88 00 02 00 00 00 00 0c 04 c0"),
    ((0, 0x00, struct.pack("<f", 0.0)), "c0 33 11 88 00 00 00 00 00 00 84 12 c0"),
    ((0, FIRST_READ + 5, b""), "c0 33 11 87 05 3e 23 c0"),
    ((1, FIRST_READ + 5, b""), "c0 33 11 c7 05 58 65 c0"),
]
REPLY, REPLY_B = "c0 11 33 a7 05 a4 70 d1 42 d4 15 c0", "c0 11 33 e7 05 a4 70 d1 42 05 17 c0"
NACK = "c0 11 33 87 07 8a c0"


def test_the_checksum_is_mcrf4xx_and_not_ccitt_false() -> None:
    """Its check value; over content and checksum together it is zero."""
    assert crc16(b"123456789") == 0x6F91
    assert crc16(b"123456789" + (0x6F91).to_bytes(2, "little")) == 0


@pytest.mark.parametrize(("wanted", "frame"), REQUESTS)
def test_requests_are_the_published_frames(wanted: tuple[int, int, bytes], frame: str) -> None:
    """Byte for byte; and the wheel's end reads out of them what was asked."""
    assert NspCodec(WHEEL, OWN).request(*wanted) == bytes.fromhex(frame)
    assert NspCodec(WHEEL, OWN).requests(bytes.fromhex(frame)).frames == (Frame(*wanted),)


@pytest.mark.parametrize(
    ("destination", "control", "data", "frame"),
    [
        (0x20, 0x87, "50", "c0 20 11 87 50 7a db dc c0"),  # the checksum holds C0
        (0x20, 0x87, "04", "c0 20 11 87 04 db dd d4 c0"),  # the checksum holds DB
        (0x20, 0x88, "00 12 c0 db dc dd", "c0 20 11 88 00 12 db dc db dd dc dd 5c ff c0"),
    ],
)
def test_escapes_are_the_published_ones(destination: int, control: int, data: str, frame: str) -> None:
    """C0 and DB inside a packet, in its data and in its checksum."""
    packet = Packet(destination, OWN, control, bytes.fromhex(data))
    assert packed(packet) == bytes.fromhex(frame)
    assert unpacked(bytes.fromhex(frame)) == ([packet], 0, b"")


def test_a_published_reply_is_the_speed_and_a_nack_is_none() -> None:
    """104.72 rad/s of file 5, with either B; refused, there is no value, and that is known; late, it is nobody's."""
    codec = NspCodec(WHEEL, OWN)
    for seq, frame in ((0, REPLY), (1, REPLY_B)):
        codec.request(seq, FIRST_READ + 5, b"")
        (reply,) = codec.replies(bytes.fromhex(frame)).frames
        assert (reply.seq, reply.id) == (seq, FIRST_READ + 5)
        assert struct.unpack("<f", reply.data)[0] == pytest.approx(104.72)
    codec.request(1, FIRST_READ + 5, b"")
    assert codec.replies(bytes.fromhex(REPLY)).frames[0].id < 0  # of the request before
    codec.request(0, FIRST_READ + 6, b"")
    assert codec.replies(bytes.fromhex(REPLY)).frames[0].id == FIRST_READ + 5  # another file than was asked for
    assert codec.replies(bytes.fromhex(NACK)).frames[0].id < 0
    assert codec.refused_to_read


@given(st.lists(st.tuples(*[st.integers(0, 255)] * 3, st.binary(max_size=40)), max_size=4), st.integers(0, 60))
def test_any_packets_come_through_however_the_bytes_are_cut(
    content: list[tuple[int, int, int, bytes]], cut: int
) -> None:
    """Whole, and in two pieces: the same packets, none damaged."""
    packets = [Packet(*fields) for fields in content]
    stream = b"".join(map(packed, packets))
    assert unpacked(stream) == (packets, 0, b"")
    first, _, rest = unpacked(stream[:cut])
    second, damaged, _ = unpacked(rest + stream[cut:])
    assert (first + second, damaged) == (packets, 0)


@given(st.binary(max_size=300))
def test_noise_never_raises_and_a_good_frame_behind_it_is_found(noise: bytes) -> None:
    """What has no end yet is bounded; the frame after an end is read whatever came before."""
    *_, rest = unpacked(noise)
    assert len(rest) <= 600
    found, _, _ = unpacked(noise + b"\xc0" + bytes.fromhex(REPLY))
    assert found[-1].data[0] == 5


class Rig:
    """A wheel on a virtual line, in its boot loader, and how to open it."""

    def __init__(self, name: str = "nsp-wheel") -> None:
        spoken = protocol_named(name)
        assert isinstance(spoken, NspProtocol)
        plant = PlantRunner(PlantParameters(), PlantNoise(0.0), 1, PlantState(speed_rad_s=50.0), 0.01)
        self.wanted: list[int] = []
        self.server = NspServer(
            spoken.wire_map, plant, faults=FaultInjector(), watch=lambda frame: self.wanted.append(frame.id)
        )
        self.clock = VirtualClock()
        self.spoken = VirtualCable(self.server, self.clock).carrying(spoken)

    def open(self) -> SerialWheel:
        """The driver."""
        wheel = self.spoken.open_wheel("nowhere", self.clock, 0.04)
        assert isinstance(wheel, SerialWheel)
        return wheel


@pytest.fixture
def rig() -> Rig:
    """Of the generation with a current mode."""
    return Rig()


def test_a_wheel_in_its_boot_loader_is_started_and_known_by_its_program(rig: Rig) -> None:
    """Attached, it reads and takes a current, it has not restarted, and its identity is not the boot loader's."""
    wheel = rig.open()
    sample = wheel.read(1.0)
    assert rig.server.started
    assert sample is not None
    assert (sample.segment, sample.news) == (0, None)
    assert sample.speed_rad_s == pytest.approx(50.0, abs=0.5)
    assert sample.bus_voltage_V == 28.0
    assert sample.temperature_degC == pytest.approx(20.0, abs=0.1)
    assert wheel.command_current(0.2).acknowledged
    assert rig.server.command_A == pytest.approx(0.2)
    assert wheel.identity is not None
    again = rig.open()
    assert again.identity == wheel.identity
    assert rig.wanted.count(INIT_ID) == 1  # a program that runs is not started again


def test_a_reset_that_nobody_asked_for_begins_a_segment(rig: Rig) -> None:
    """Back in the boot loader: no reading is made up, INIT once, a new segment that says why, and the same wheel."""
    wheel = rig.open()
    assert wheel.read(1.0) is not None
    before = wheel.identity
    rig.clock.sleep(1.0)
    rig.server.restart()
    samples = [wheel.read(0.09) for _ in range(6)]
    came = [sample for sample in samples if sample is not None]
    assert samples[0] is None
    assert [sample.segment for sample in came] == [1] * len(came)
    assert came[0].news is not None
    assert came[0].news[0] == "wheel_restarted"
    wheel.read(1.0)
    assert wheel.identity == before


def test_a_file_that_the_wheel_does_not_have_does_not_restart_it(rig: Rig) -> None:
    """One refused read among good ones is no boot loader."""
    rig.open()
    put_faults(rig.server, "")
    original = rig.server._answer

    def without_temperature(frame: Frame, register: object) -> bytes | None:
        return b"" if frame.id == FIRST_READ + 3 else original(frame, register)  # type: ignore[arg-type]

    rig.server._answer = without_temperature  # type: ignore[method-assign]
    wheel = rig.open()
    samples = [wheel.read(1.0) for _ in range(8)]
    assert all(sample is not None and sample.temperature_degC is None for sample in samples)
    assert rig.wanted.count(INIT_ID) == 1


def test_a_wheel_that_does_not_copy_b_is_not_misread(rig: Rig) -> None:
    """It is seen from the replies; late ones are told by the quiet that is waited for, and never taken for the next."""
    bare = rig.server._codec.reply
    rig.server._codec.reply = lambda answer: bare(Frame(0, answer.id, answer.data))  # type: ignore[method-assign]
    wheel = rig.open()
    assert [wheel.read(1.0) is not None for _ in range(5)] == [True] * 5
    put_faults(rig.server, "delay/from:60ms:1/3")
    for _ in range(12):
        rig.server.plant.state = rig.server.plant.state._replace(speed_rad_s=rig.server.plant.state.speed_rad_s + 1.0)
        true = rig.server.plant.state.speed_rad_s
        sample = wheel.read(0.5)
        assert sample is None or sample.speed_rad_s == pytest.approx(true, abs=0.5)


def test_zero_is_confirmed_by_a_wheel_that_is_in_its_boot_loader(rig: Rig) -> None:
    """`rw-ekf stop` opens without asking: the refused zero has it started, which leaves it idle, and is confirmed."""
    wheel = rig.spoken.open_wheel("nowhere", rig.clock, 0.04, probe=False)
    assert wheel.stop_current().acknowledged
    assert rig.server.command_A == 0.0


def test_a_wheel_that_cannot_be_started_is_an_error_that_says_so(rig: Rig) -> None:
    """INIT of another address is refused: no daemon attaches, and the sentence names the key."""
    rig.server.wire_map = rig.server.wire_map.model_copy(
        update={"framing": rig.server.wire_map.framing.model_copy(update={"init_address": 0x2000})}
    )
    with pytest.raises(DriverError, match=r"refuses every read.*framing\.init_address"):
        rig.open()
    assert 1 <= rig.wanted.count(INIT_ID) <= 3  # once a second


@pytest.mark.parametrize("name", ["nsp-wheel-torque", "nsp-wheel-large"])
def test_a_torque_stands_where_a_current_would(name: str) -> None:
    """Newton metres on the wire, as they are written; the limits of the wire are those of its float."""
    rig = Rig(name)
    wheel = rig.open()
    assert wheel.read(1.0) is not None
    assert wheel.command_current(0.0012).current_A == pytest.approx(0.0012)
    assert rig.server.command_A == pytest.approx(0.0012)
