"""The adapter's lines against python-can, which is another's work; spoilt lines; pieces cut anywhere."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.drivers.can import slcan
from rw_ekf.drivers.can.can_frames import CanFrame
from tests.live.bench import served_wheel, wait_for
from tests.live.can_bus import codec_of

can = pytest.importorskip("can")

FRAMES = [
    CanFrame(0x181, bytes(range(8))),
    CanFrame(0x000, b""),
    CanFrame(0x7FF, b"\xff"),
    CanFrame(0x1ABCDEF0, b"\x12\x34", extended=True),
    CanFrame(0x181, b"", remote=True),
]


@pytest.mark.parametrize("frame", FRAMES, ids=str)
def test_a_frame_goes_there_and_back(frame: CanFrame) -> None:
    """What is encoded decodes to the same, wherever the bytes are cut; nothing is damaged."""
    line = slcan.encode(frame)
    for at in range(len(line) + 1):
        first = slcan.decode(line[:at])
        second = slcan.decode(first.rest + line[at:])
        assert [*first.frames, *second.frames] == [frame]
        assert first.damaged + second.damaged == 0
        assert second.rest == b""


@pytest.mark.parametrize(
    "line",
    ["t18", "t1812", "t181901", "t1812AAG0", "t8001AA", "T200000001AA", "t1811AABB", "?!", "tt1811"],
)
def test_a_spoilt_line_is_no_frame(line: str) -> None:
    """Too short, nine bytes, no hexadecimal digit, an identifier too large, too long: damaged; the next is whole."""
    found = slcan.decode(line.encode() + b"\r" + slcan.encode(FRAMES[0]))
    assert found.frames == [FRAMES[0]]
    assert found.damaged >= 1


def test_noise_is_bounded_and_a_good_line_behind_it_is_found() -> None:
    """A megabyte without an end keeps less than a line; junk before a frame in its line costs the junk."""
    noise = random.Random(1).randbytes(1_000_000).replace(b"\r", b"x").replace(b"\a", b"x")
    found = slcan.decode(noise)
    assert len(found.rest) < 40
    assert found.damaged > 0
    found = slcan.decode(b"\x00\xffjunk" + slcan.encode(FRAMES[0]))
    assert (found.frames, found.damaged) == ([FRAMES[0]], 1)


def test_python_can_hears_and_commands_the_simulated_wheel(tmp_path: Path) -> None:
    """The simulated adapter is one to python-can's slcan too: each count behind the other, and a command in force."""
    with (
        served_wheel(tmp_path, protocol="can-wheel") as bench,
        can.Bus(interface="slcan", channel=bench.port, bitrate=500_000, sleep_after_open=0.0) as bus,
    ):
        motions: list[Any] = []

        def heard() -> bool:
            message = bus.recv(0.1)
            if message is not None and message.arbitration_id == 0x181:
                motions.append(codec_of(bench, "Motion").unpack(CanFrame(0x181, bytes(message.data))))
            return len(motions) >= 20

        wait_for(heard)
        counts = [alive for _, alive in motions]
        assert counts == [(counts[0] + i) % 256 for i in range(20)]
        frame = codec_of(bench, "Command").pack({"Current": 2500, "Enable": 1}, 1)
        bus.send(can.Message(arbitration_id=frame.id, data=frame.data, is_extended_id=False))
        wait_for(lambda: bench.registers.command_A == pytest.approx(0.25))
        wait_for(lambda: heard() and motions[-1][0]["CurrentCommand"] == 2500)
