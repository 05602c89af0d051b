"""Lines of text: published checksums, what is asked and answered, late answers, wheels that must be made ready."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rw_ekf.clock import VirtualClock
from rw_ekf.commissioning.map_copy import write_corrected_map
from rw_ekf.driver import ZERO_BY_MODE
from rw_ekf.drivers.line.ascii_codec import STARTUP_ID, checksum_of
from rw_ekf.drivers.line.ascii_protocol import AsciiProtocol
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.drivers.sim.ascii_server import AsciiServer
from rw_ekf.drivers.sim.faults import FaultInjector
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.virtual_line import VirtualCable
from rw_ekf.errors import DriverError
from tests.injecting import put_faults
from tests.live.bench import protocol_named, wire_map_of

# The smallest map: nothing but a speed and a current that nothing acknowledges.
BARE = """
family: ascii
framing: {FRAMING}
link: {baud: 115200}
EXTRA
registers:
  - name: speed
    access: read
    request: "RPM?"
    reply: "{speed}"
    fields: [{name: speed, unit: rad/s, range: [-1000, 1000], most_per_s: 2000}]
  - name: current_command
    access: write
    request: "CUR={current_command:.2f}"
    fields: [{name: current_command, unit: A, range: [-1, 1]}]
"""


class Rig:
    """A wheel on a virtual line, and how to open it."""

    def __init__(self, name: str = "ascii-wheel") -> None:
        spoken = protocol_named(name)
        assert isinstance(spoken, AsciiProtocol)
        plant = PlantRunner(PlantParameters(), PlantNoise(0.0), 1, PlantState(speed_rad_s=50.0), 0.01)
        self.wanted: list[int] = []
        self.server = AsciiServer(
            spoken.wire_map, plant, faults=FaultInjector(), watch=lambda frame: self.wanted.append(frame.id)
        )
        self.clock = VirtualClock()
        self.spoken = VirtualCable(self.server, self.clock).carrying(spoken)

    def open(self, *, probe: bool = True) -> SerialWheel:
        """The driver."""
        wheel = self.spoken.open_wheel("nowhere", self.clock, 0.04, probe=probe)
        assert isinstance(wheel, SerialWheel)
        return wheel

    def spin(self, rad_s: float) -> None:
        """Let it turn at another speed."""
        self.server.plant.state = self.server.plant.state._replace(speed_rad_s=rad_s)

    def start_lines(self) -> list[int]:
        """The lines of the start that it has heard, by number."""
        return [number - STARTUP_ID for number in self.wanted if number >= STARTUP_ID]


def bare(directory: Path, extra: str = "", framing: str = "terminator: crlf") -> str:
    """The path of the smallest map, with keys of its own."""
    path = directory / "map.yaml"
    path.write_text(BARE.replace("EXTRA", extra).replace("FRAMING", framing), encoding="utf-8")
    return str(path)


def test_checksums_are_the_published_ones() -> None:
    """NMEA 0183's example sentences, ODrive's documented line, CRC-16/MODBUS's check value."""
    assert checksum_of(b"$GPGLL,5057.970,N,00146.110,E,142451,A", "xor") == "27"
    assert checksum_of(b"$GPVTG,089.0,T,,,15.2,N,,", "xor") == "7F"
    assert checksum_of(b"r vbus_voltage ", "xor-decimal") == "93"
    assert checksum_of(b"123456789", "crc16-modbus") == "4B37"


def test_a_line_s_answer_is_the_wheel_s(tmp_path: Path) -> None:
    """Everything in one answer, rounded as it is printed; who answers; a current is acknowledged and in force."""
    rig = Rig()
    wheel = rig.open()
    sample = wheel.read(1.0)
    assert sample is not None
    assert sample.speed_rad_s == pytest.approx(50.0, abs=0.5)
    assert (sample.bus_voltage_V, sample.current_A, sample.current_command_A) == (28.0, 0.0, 0.0)
    assert sample.temperature_degC == pytest.approx(20.0, abs=0.1)
    assert wheel.identity is not None
    assert wheel.identity.serial_number == 1
    issued = wheel.command_current(0.123456)
    assert issued.acknowledged
    assert issued.current_A == rig.server.command_A == 0.1234  # toward zero: a limit is a limit
    assert (wheel.link.timeouts, wheel.link.stale, wheel.link.damaged) == (0, 0, 0)


def test_a_current_beyond_the_map_s_range_is_never_sent() -> None:
    """Text carries any number: the map bounds it, and no number that is none goes out."""
    rig = Rig()
    wheel = rig.open()
    before = len(rig.wanted)
    for current_A in (3.01, -3.01, 1e9, math.inf, math.nan):
        with pytest.raises(DriverError):
            wheel.command_current(current_A)
    assert len(rig.wanted) == before


@pytest.mark.parametrize(
    "framing", ["terminator: cr", "terminator: lf", "terminator: crlf, prompt: '> ', echoes: true"]
)
def test_line_ends_prompts_and_echoes(tmp_path: Path, framing: str) -> None:
    """Any end of a line; a prompt before the answer and the request repeated are skipped, and are no faults."""
    rig = Rig(bare(tmp_path, framing=framing))
    wheel = rig.open()
    for current_A in (0.1, -0.2, 0.0):
        assert wheel.read(1.0) is not None
        assert wheel.command_current(current_A).acknowledged
        assert rig.server.command_A == current_A
    assert (wheel.link.timeouts, wheel.link.stale, wheel.link.damaged) == (0, 0, 0)


@pytest.mark.parametrize("delay_ms", [41, 60, 85, 115, 150, 215, 230, 260, 315, 330, 415, 900])
@pytest.mark.parametrize("name", ["bare", "ascii-wheel", "odrive-ascii-wheel"])
def test_a_line_that_keeps_every_answer_brings_no_old_reading(tmp_path: Path, name: str, delay_ms: int) -> None:
    """Late by up to nine requests, with nothing in an answer that tells them apart: none is taken for a new one."""
    rig = Rig(bare(tmp_path) if name == "bare" else name)
    wheel = rig.open()
    assert wheel.read(1.0) is not None
    put_faults(rig.server, f"delay/from:{delay_ms}ms")
    for _ in range(60):
        turn_s = rig.clock.monotonic()
        rig.spin(100.0 + 10.0 * turn_s)
        sample = wheel.read(0.09)
        assert sample is None or sample.speed_rad_s == pytest.approx(100.0 + 10.0 * turn_s, abs=0.5)
        rig.clock.sleep(max(0.0, turn_s + 0.1 - rig.clock.monotonic()))
    put_faults(rig.server, "")
    rig.clock.sleep(1.2)  # until the last of them has come
    assert [wheel.read(0.09) is not None for _ in range(3)] == [True] * 3


@pytest.mark.parametrize("name", ["bare", "ascii-wheel", "odrive-ascii-wheel"])
def test_lost_answers_cost_few_readings_and_bring_no_wrong_one(tmp_path: Path, name: str) -> None:
    """One answer in ten lost: most readings come, each of its own turn, and it is as before when the fault is over."""
    rig = Rig(bare(tmp_path) if name == "bare" else name)
    wheel = rig.open()
    put_faults(rig.server, "drop/from:0.1")
    came = 0
    for _ in range(200):
        turn_s = rig.clock.monotonic()
        rig.spin(100.0 + 10.0 * turn_s)
        sample = wheel.read(0.09)
        came += sample is not None
        assert sample is None or sample.speed_rad_s == pytest.approx(100.0 + 10.0 * turn_s, abs=0.5)
        rig.clock.sleep(max(0.0, turn_s + 0.1 - rig.clock.monotonic()))
    assert came > 120
    put_faults(rig.server, "")
    assert [wheel.read(0.09) is not None for _ in range(12)][2:] == [True] * 10


def test_a_late_confirmation_is_not_the_next_command_s(tmp_path: Path) -> None:
    """OK of the command before, while the present one is lost: not acknowledged."""
    rig = Rig()
    wheel = rig.open()
    wheel.read(1.0)
    put_faults(rig.server, "delay/current_command:60ms")
    wheel.command_current(0.1)
    put_faults(rig.server, "drop/to,silence/cycle")
    issued = wheel.command_current(0.2)
    assert not issued.acknowledged
    assert rig.server.command_A == 0.1


@pytest.mark.parametrize("fault", ["flip/from:1:2", "cut/from:9", "insert/from:1:3"])
def test_a_damaged_line_is_no_reading(fault: str) -> None:
    """Wrong bits, a torn line, junk around it, every answer for a minute: none passes the checksum and the form."""
    rig = Rig()
    wheel = rig.open()
    wheel.read(1.0)
    put_faults(rig.server, fault)
    for _ in range(300):
        sample = wheel.read(0.05)
        assert sample is None or sample.speed_rad_s == pytest.approx(rig.server.plant.speed_rad_s, abs=0.2)
    put_faults(rig.server, "")
    rig.clock.sleep(1.2)
    assert [wheel.read(0.09) is not None for _ in range(4)][1:] == [True] * 3


def test_a_digit_lost_is_seen_by_the_step(tmp_path: Path) -> None:
    """Without a checksum: 50 of 500 is not believed; a true step is, when it is read twice."""
    rig = Rig(bare(tmp_path))
    wheel = rig.open()
    rig.spin(500.0)
    wheel.read(1.0)
    rig.clock.sleep(1.0)  # what is known of the speed is then of no use
    first = wheel.read(1.0)
    assert first is not None
    put_faults(rig.server, "value/speed:speed=50.0:1/1")
    rig.clock.sleep(0.1)
    assert wheel.read(1.0) is None
    put_faults(rig.server, "")
    rig.clock.sleep(0.1)
    assert wheel.read(1.0) is not None
    rig.spin(-500.0)
    rig.clock.sleep(0.1)
    assert wheel.read(1.0) is None
    rig.clock.sleep(0.1)
    again = wheel.read(1.0)
    assert again is not None
    assert again.speed_rad_s == pytest.approx(-500.0, abs=2.0)
    rig.spin(1001.0)
    assert wheel.read(1.0) is None  # beyond the range
    assert wheel.link.damaged == 3


def test_a_line_without_its_end_is_no_number(tmp_path: Path) -> None:
    """`12` of `123.4`, then silence: no reading; nor is the other half, which comes too late, one."""
    rig = Rig(bare(tmp_path))
    wheel = rig.open()
    rig.spin(123.4)
    wheel.read(1.0)
    put_faults(rig.server, "cut/from:2")
    assert wheel.read(0.09) is None
    put_faults(rig.server, "dribble/from:50ms")  # slower than any reply may be
    for _ in range(40):
        sample = wheel.read(0.09)
        assert sample is None or sample.speed_rad_s == pytest.approx(rig.server.plant.speed_rad_s, abs=1.0)
        rig.clock.sleep(0.01)


def test_a_command_without_an_answer_is_confirmed_by_a_question(tmp_path: Path) -> None:
    """Where nothing tells what is in force: acknowledged if the wheel answers the question behind it, else not."""
    rig = Rig(bare(tmp_path))
    wheel = rig.open()
    wheel.read(1.0)
    assert wheel.command_current(0.25).acknowledged
    assert rig.server.command_A == 0.25
    put_faults(rig.server, "silence")
    issued = wheel.stop_current()
    assert (issued.acknowledged, issued.reason) == (False, "timeout")
    assert rig.server.command_A == 0.0  # it was sent all the same


def test_an_odrive_is_made_ready_before_its_first_torque_and_again_when_it_was_away() -> None:
    """Never for a zero, nor by who only reads; a zero goes before; the torque that is in force is read back."""
    rig = Rig("odrive-ascii-wheel")
    wheel = rig.open()
    assert wheel.read(1.0) is not None
    assert wheel.stop_current().acknowledged
    assert rig.start_lines() == []
    issued = wheel.command_current(0.0123456)
    assert issued.acknowledged
    assert issued.current_A == pytest.approx(0.01234)
    assert rig.server.command_A == pytest.approx(0.01234)
    assert rig.start_lines() == [0, 1, 2]
    command = rig.server.wire_map.current_command.id
    assert rig.wanted.index(command) < rig.wanted.index(STARTUP_ID)
    assert wheel.read(1.0) is not None
    rig.server.restart()
    put_faults(rig.server, "silence")
    for _ in range(10):
        assert wheel.read(0.09) is None
        rig.clock.sleep(0.05)
    put_faults(rig.server, "")
    rig.clock.sleep(0.5)
    sample = next(filter(None, (wheel.read(0.5) for _ in range(3))))
    assert sample.news is not None
    assert (sample.segment, sample.news[0]) == (1, "wheel_restarted")
    assert wheel.command_current(0.01).acknowledged
    assert rig.start_lines() == [0, 1, 2, 0, 1, 2]


def test_a_torque_that_is_told_with_the_other_sign_is_not_taken(tmp_path: Path) -> None:
    """A map whose command alone has the wrong sign: what is read back says so."""
    rig = Rig("odrive-ascii-wheel")
    wrong = write_corrected_map("odrive-ascii-wheel", {("current_command", "write"): -1.0}, tmp_path)
    wheel = VirtualCable(rig.server, rig.clock).carrying(protocol_named(wrong)).open_wheel("nowhere", rig.clock, 0.04)
    assert wheel.command_current(0.01).reason == "opposite"
    assert rig.server.command_A == pytest.approx(-0.01)


@pytest.mark.parametrize("name", ["arduino", "odrive-ascii-wheel"])
def test_a_restart_that_nobody_saw_is_found_by_what_is_refused(tmp_path: Path, name: str) -> None:
    """Without a line, a clock or a silence: a current refused, or not in force, has the start sent again, once."""
    extra = "startup: [ARM]\nrefusals: {not_armed: DISARMED}"
    rig = Rig(bare(tmp_path, extra) if name == "arduino" else name)
    wheel = rig.open()
    wheel.read(1.0)
    assert wheel.command_current(0.02).acknowledged
    rig.clock.sleep(1.0)
    rig.server.restart()
    for _ in range(3):
        wheel.command_current(0.02)
        wheel.read(0.09)
        rig.clock.sleep(0.1)
    assert rig.server.command_A == pytest.approx(0.02)
    assert rig.start_lines() == 2 * list(range(len(rig.server.wire_map.startup)))


def test_a_wheel_that_says_that_it_restarted_begins_one_segment(tmp_path: Path) -> None:
    """By its line, with and without a clock: one segment, said, and it is made ready before it is driven again."""
    start = 'restarted: "Wheel {_} ready"\nstartup: [ARM]'
    rig = Rig(bare(tmp_path, start.replace("{_}", "7")))
    wheel = rig.open()
    wheel.read(1.0)
    assert wheel.command_current(0.2).acknowledged
    rig.server.restart()
    samples = [wheel.read(0.09) for _ in range(3)]
    assert [sample.segment for sample in samples if sample is not None] == [1] * 3
    assert wheel.command_current(0.2).acknowledged
    assert rig.server.command_A == 0.2
    assert rig.start_lines() == [0, 0]
    rig = Rig()
    wheel = rig.open()
    rig.clock.sleep(1.0)
    wheel.read(1.0)
    rig.server.restart()
    assert [sample.segment for sample in (wheel.read(0.09) for _ in range(3)) if sample is not None] == [1] * 3


def test_a_start_that_is_refused_is_an_error_that_names_the_line(tmp_path: Path) -> None:
    """What the wheel said and to what; no current has gone out."""
    rig = Rig(bare(tmp_path, 'refusals: {unknown_id: "what?"}\nstartup: [ARM]'))
    original = rig.server._answer

    def refuses(frame, register):  # type: ignore[no-untyped-def]
        return b"\1" if frame.id >= STARTUP_ID else original(frame, register)

    rig.server._answer = refuses  # type: ignore[method-assign]
    wheel = rig.open()
    with pytest.raises(DriverError, match=r"answers 'what\?' to 'ARM'"):
        wheel.command_current(0.1)
    assert rig.server.command_A == 0.0


def test_a_zero_that_is_refused_lets_go_by_the_idle_line() -> None:
    """ERR MODE to zero: the idle line, which has no number in it, and its reason."""
    rig = Rig()
    wheel = rig.open()
    wheel.command_current(0.3)
    put_faults(rig.server, "nack/current_command")
    stopped = wheel.stop_current()
    assert (stopped.acknowledged, stopped.reason) == (True, ZERO_BY_MODE)
    assert rig.server.command_A == 0.0
    put_faults(rig.server, "nack/current_command:3")
    assert wheel.command_current(0.2).reason == "out_of_range"


def test_who_speaks_otherwise_is_quoted(tmp_path: Path) -> None:
    """A map that does not fit: the error of opening shows the line that came."""
    rig = Rig(bare(tmp_path))
    path = Path(bare(tmp_path))
    path.write_text(path.read_text(encoding="utf-8").replace('"{speed}"', '"RPM={speed}"'), encoding="utf-8")
    rig.spoken.wire_map = protocol_named(str(path)).wire_map
    with pytest.raises(DriverError, match=r"no valid frame.*What came last was '[0-9.]+': no line of the wire map"):
        rig.open()


@given(st.lists(st.binary(max_size=400), max_size=6))
def test_noise_never_raises_and_is_bounded(pieces: list[bytes]) -> None:
    """Whatever comes; a good line behind an end is read."""
    codec = wire_map_of("odrive-ascii-wheel").codec()
    codec.request(1, 128, b"")
    rest = b""
    for piece in pieces:
        rest = codec.replies(rest + piece).rest
        assert len(rest) <= 256
    found = codec.replies(
        rest + b"\r\n" + b"1.500000 -2.000000*" + checksum_of(b"1.500000 -2.000000", "xor-decimal").encode() + b"\r\n"
    )
    assert found.frames[-1].id == 128
