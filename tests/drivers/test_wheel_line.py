"""A wheel's line with faults, in the wheel's time: what each kind makes of requests and replies."""

from __future__ import annotations

import math

import pytest

from rw_ekf.drivers.line.framing import Frame, decode, encode
from rw_ekf.drivers.line.registers import decode_register
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.drivers.sim.fault_text import parse_faults
from rw_ekf.drivers.sim.faults import FaultInjector
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.register_server import RegisterServer
from rw_ekf.drivers.sim.wheel_line import WheelLine

CURRENT_COMMAND, STATUS, IDENTITY, CYCLE = 3, 130, 128, 137


class Wanted:
    """A line that is asked in the wheel's time."""

    def __init__(self, wire_map: WireMap, *faults: str) -> None:
        plant = PlantRunner(PlantParameters(), PlantNoise(0.0), 1, PlantState(speed_rad_s=50.0))
        self.server = RegisterServer(wire_map, plant, faults=FaultInjector(parse_faults(faults), 7))
        self.line = WheelLine(self.server)
        self.map = wire_map
        self.now_s = 0.0

    def heard(self, seq: int, register_id: int, data: bytes = b"", for_s: float = 0.05) -> bytes:
        """Everything that comes back within for_s [s] of a request."""
        self.line.take(encode(seq, register_id, data), self.now_s)
        came, end_s = b"", self.now_s + for_s
        while self.now_s < end_s:
            came += self.line.work(self.now_s)
            self.now_s += 0.001
        return came

    def frames(self, seq: int, register_id: int = CYCLE, data: bytes = b"", for_s: float = 0.05) -> tuple[Frame, ...]:
        """The good frames of it."""
        return decode(self.heard(seq, register_id, data, for_s)).frames

    def cycle(self, seq: int = 1) -> dict[str, float]:
        """Values of a cycle."""
        register = self.map.register_of_id(CYCLE)
        assert register is not None
        (frame,) = self.frames(seq)
        return decode_register(register, frame.data)


@pytest.mark.parametrize(
    ("fault", "good"),
    [
        ("drop", 0), ("drop/to", 0), ("drop/status", 1), ("cut/from:7", 0), ("cut/to:7", 0),
        ("silence", 0), ("insert/from:1:30", 1), ("insert/to", 1), ("duplicate/from", 2),
        ("duplicate/to", 2), ("dribble:1ms", 1), ("delay:20ms", 1), ("delay:40ms", 0), ("echo", 2),
        ("reorder/from", 0), ("hold/from@0s:30ms", 1), ("hold/from@0s:90ms", 0), ("hold/from:16ms", 1),
        ("flood:500", 1), ("flood/to:500", 1),
    ],
)  # fmt: skip
def test_what_comes_of_one_request(wire_map: WireMap, fault: str, good: int) -> None:
    """So many good frames come back within 50 ms under each fault of the line."""
    wanted = Wanted(wire_map, fault)
    assert len(wanted.frames(1)) == good


def test_bits_are_wrong_and_the_checksum_says_so(wire_map: WireMap) -> None:
    """No reply with a flipped bit is a good frame, whichever bit it was; without the fault all are."""
    wanted = Wanted(wire_map, "flip/from:1:1@0s:10s")
    assert not any(wanted.frames(seq) for seq in range(100))
    wanted.now_s = 11.0
    assert all(wanted.frames(seq) for seq in range(20))


def test_a_kept_reply_comes_behind_the_next_one(wire_map: WireMap) -> None:
    """Every second reply is kept back and overtaken."""
    wanted = Wanted(wire_map, "reorder/from")
    assert [[f.seq for f in wanted.frames(seq)] for seq in range(4)] == [[], [1, 0], [], [3, 2]]


def test_held_bytes_come_at_once(wire_map: WireMap) -> None:
    """Three replies asked for during a hold are there together when it ends, and not before."""
    wanted = Wanted(wire_map, "hold@0s:200ms")
    assert [wanted.heard(seq, CYCLE) for seq in range(3)] == [b"", b"", b""]
    assert [frame.seq for frame in wanted.frames(3, for_s=0.1)] == [0, 1, 2, 3]


def test_frames_of_another_seq_id_and_length(wire_map: WireMap) -> None:
    """Their checksums are good: only what they say is wrong."""
    size = len(Wanted(wire_map).frames(9)[0].data)
    for fault, seq, register_id, length in (
        ("seq:1:2", 7, CYCLE, size), ("id", 9, CYCLE + 1, size), ("length", 9, CYCLE, size + 1),
    ):  # fmt: skip
        (frame,) = Wanted(wire_map, fault).frames(9)
        assert (frame.seq, frame.id, len(frame.data)) == (seq, register_id, length)


def test_telemetry_that_stands_still_repeats_or_is_wild(wire_map: WireMap) -> None:
    """Frozen: the values stand and the clock goes on; repeated: all of it stands; wild: that field alone."""
    for fault, still, going in (("freeze", "speed", "uptime"), ("freeze:speed", "speed", "uptime")):
        wanted = Wanted(wire_map, fault)
        wanted.server.plant.command(1.0)
        values = [wanted.cycle(seq) for seq in range(20)]
        assert len({v[still] for v in values}) == 1
        assert len({v[going] for v in values}) == 20
    wanted = Wanted(wire_map, "repeat/cycle")
    assert len({tuple(wanted.cycle(seq).values()) for seq in range(5)}) == 1
    wanted = Wanted(wire_map, "value:temperature=55.5")
    assert wanted.cycle()["temperature"] == 55.5
    assert wanted.cycle()["speed"] == pytest.approx(50.0, abs=0.5)
    for number, count in (("inf", 32767), ("-inf", -32768), ("nan", -32768)):
        assert Wanted(wire_map, f"value:speed={number}").cycle()["speed"] == pytest.approx(count * 0.5 * math.pi / 30.0)
    speeds = [wanted.cycle()["speed"] for wanted in [Wanted(wire_map, "spike:1000:1/2")] for _ in range(6)]
    assert sum(abs(speed - 50.0) > 100.0 for speed in speeds) == 3


def test_a_refused_write_is_not_done_unless_it_acts(wire_map: WireMap) -> None:
    """Both answer with the status; only one of them changes the current."""
    data = (1000).to_bytes(2, "little", signed=True)
    for fault, current_A in (("nack:3", 0.0), ("nack-acted:3", 0.1), ("nack/mode", 0.1)):
        wanted = Wanted(wire_map, fault)
        (frame,) = wanted.frames(1, CURRENT_COMMAND, data)
        assert frame.data == (b"\x03" if "mode" not in fault else b"\0")
        assert wanted.server.command_A == pytest.approx(current_A)


def test_what_happens_to_the_wheel_happens_once_a_stretch(wire_map: WireMap) -> None:
    """Restart and jump of the clock come at their times, heat and flags last as long as they should."""
    wanted = Wanted(wire_map, "reset@1s:0.5s:2s,clock:100s@10s,heat:80@20s:5s,flag:1@30s:1s,serial:9@40s")
    wanted.server.plant.command(0.5)
    wanted.now_s = 0.9
    assert wanted.cycle()["uptime"] > 0.8
    wanted.now_s = 1.1
    wanted.frames(0)  # here it restarts
    assert wanted.cycle()["uptime"] < 0.2
    assert wanted.server.command_A == 0.0
    wanted.now_s = 10.9
    wanted.frames(0)
    assert wanted.cycle()["uptime"] > 100.0
    for now_s, hot in ((19.0, False), (20.1, True), (24.0, True), (25.5, False)):
        wanted.now_s = now_s
        wanted.frames(0)
        assert (wanted.cycle()["temperature"] == pytest.approx(80.0, abs=0.1)) is hot
    wanted.now_s = 30.1
    assert wanted.frames(0, STATUS)[0].data[1] & 1
    wanted.now_s = 41.0
    assert int.from_bytes(wanted.frames(0, IDENTITY)[0].data[2:4], "little") == 9


def test_a_fault_of_what_the_map_does_not_have(wire_map: WireMap) -> None:
    """A register or a field that no map names is a mistake of the text, not a fault that never strikes."""
    from rw_ekf.drivers.sim.pty_server import check_faults
    from rw_ekf.errors import BadInputError

    check_faults(parse_faults(["value/cycle:speed=1,drop/status,freeze"]), wire_map)
    with pytest.raises(BadInputError, match="no register 'cylce'; it has: reset, "):
        check_faults(parse_faults(["drop/cylce"]), wire_map)
    with pytest.raises(BadInputError, match=r"tells 'sped'; they tell: .*speed"):
        check_faults(parse_faults(["freeze:sped"]), wire_map)
