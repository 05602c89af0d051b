"""Frames in pieces, damaged, endless, late, twice, of our own, of somebody else: none is taken for a reading."""

from __future__ import annotations

import pytest

from rw_ekf.clock import SystemClock
from rw_ekf.drivers.line.framing import MAX_DATA_BYTES
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.records import WheelSample
from tests.faults.ports import Babbling, opening
from tests.faults.rig import EACH_FAMILY_ON_A_LINE, is_unsolicited, let_pass, open_timed, port_of
from tests.live.bench import Bench
from tests.live.daemon import run
from tests.live.test_line_faults import error_rpm, fault
from tests.serial_wheels import open_serial_wheel

pytestmark = [EACH_FAMILY_ON_A_LINE, pytest.mark.usefixtures("family")]

CLOCK = SystemClock()
MEGABYTE = 1_000_000


def samples_of(bench: Bench, wheel: SerialWheel, times: int) -> list[WheelSample | None]:
    """So many readings, each asked for after the one before; none is older than its request, or than is fresh."""
    samples = []
    older_s = 0.040 if is_unsolicited(wheel) else 0.002
    for _ in range(times):
        # One that sends by itself is asked nothing: what it told last is the newest that can be on its way.
        now_s = bench.registers.plant.time_s if is_unsolicited(wheel) else bench.wheel_time_s()
        wanted_s = now_s + 100.0  # the bench's wheels have been up for so long
        samples.append(wheel.read(1.0))
        if samples[-1] is not None and wheel._uptime_field is not None:  # else its time is that of the request
            assert samples[-1].time_s > wanted_s - older_s
    return samples


def recovers(bench: Bench, wheel: SerialWheel) -> bool:
    """Without faults: the second reading at the latest is one, and so are all behind it."""
    bench.fault("")
    came = [sample is not None for sample in samples_of(bench, wheel, 8)]
    return all(came[2:]) and wheel.command_current(0.0).acknowledged


def test_a_frame_in_pieces_is_put_together(timed: Bench, timed_wheel: SerialWheel) -> None:
    """Row 7: byte by byte within the time of a reply, every sample comes."""
    timed.fault("dribble:0.05ms" if is_unsolicited(timed_wheel) else "dribble:1ms")  # before the next one comes
    assert all(samples_of(timed, timed_wheel, 5))
    assert timed_wheel.link.damaged == 0
    assert recovers(timed, timed_wheel)


def test_a_frame_that_does_not_end_in_time_is_dropped(timed: Bench, family: str) -> None:
    """Row 7: one byte every 5 ms is slower than a reply may be: no sample; its beginning is dropped and counted."""
    bench, wheel = timed, open_timed(timed, family, 0.05)
    assert timed.cable is not None
    clock = timed.cable.clock
    bench.fault("dribble/from:5ms")
    let_pass(wheel)
    assert not any(wheel.read(0.05) for _ in range(6))
    bench.fault("")
    clock.sleep(0.3)  # until the last of them has come
    assert recovers(bench, wheel)
    bench.fault(f"cut/{bench.registers.wire_map.speed_register.name}:6")
    let_pass(wheel)
    assert wheel.read(0.05) is None
    damaged = wheel.link.damaged
    clock.sleep(0.2)
    bench.fault("")
    assert wheel.read(1.0) is not None
    assert wheel.link.damaged == damaged + 1 or (is_unsolicited(wheel) and wheel.link.damaged > damaged)
    assert recovers(bench, wheel)
    wheel.close()


@pytest.mark.parametrize("text", ["flip", "flip:1:3", "cut/from:9", "insert:1:30", "flood:2000", "flip/to,insert/from"])
def test_noise_is_rejected_and_the_line_is_in_step_again_at_once(
    timed: Bench, timed_wheel: SerialWheel, text: str
) -> None:
    """Row 8: wrong bits, torn frames, junk around and between frames: no wrong value; all is well soon after."""
    timed.fault(text)
    for sample in samples_of(timed, timed_wheel, 15):
        assert sample is None or sample.speed_rad_s == pytest.approx(20.0, abs=1.5)
    if "insert:" not in text and "flood" not in text:
        assert timed_wheel.link.damaged + timed_wheel.link.timeouts > 0
    assert recovers(timed, timed_wheel)


def test_a_megabyte_without_an_end_is_bounded(bench: Bench, wire_map: WireMap) -> None:
    """Row 9: a frame that never ends: what is kept is less than a frame; then the wheel is there again."""
    babbling: list[Babbling] = []

    def wrap(port: object) -> Babbling:
        babbling.append(Babbling(port, b""))
        return babbling[0]

    wheel = open_serial_wheel(bench.port, wire_map, CLOCK, 0.15, open_port=opening(wrap))
    babbling[0].junk = b"\x1f\x7f\x02\xff" + bytes(MEGABYTE)
    kept = []
    while babbling[0].junk:
        assert wheel.read(0.05) is None or not babbling[0].junk
        kept.append(len(port_of(wheel)._rest))
    assert max(kept) < 2 * MAX_DATA_BYTES + 16
    assert wheel.link.damaged > 0
    assert port_of(wheel).received_bytes > MEGABYTE
    assert recovers(bench, wheel)
    wheel.close()


def test_late_replies_are_dropped(timed: Bench, timed_wheel: SerialWheel) -> None:
    """Row 10: 15 % come after their deadline: none answers another request, no reading comes twice."""
    timed.fault("delay/from:200ms:15%")
    samples = [sample for sample in samples_of(timed, timed_wheel, 60) if sample is not None]
    times = [sample.time_s for sample in samples]
    assert len(set(times)) == len(times) >= 30
    assert times == sorted(times)
    assert timed_wheel.link.stale > 0
    assert recovers(timed, timed_wheel)


def test_a_reply_that_comes_twice_counts_once(bench: Bench, wheel: SerialWheel) -> None:
    """Row 11: the second one is stale, for readings and confirmations alike."""
    bench.fault("duplicate/from")
    samples = samples_of(bench, wheel, 10)
    assert all(samples)
    assert len({sample.time_s for sample in samples if sample is not None}) == 10
    assert all(wheel.command_current(0.01 * i).acknowledged for i in range(5))
    assert bench.registers.command_A == pytest.approx(0.04)
    assert wheel.link.stale >= 10
    assert recovers(bench, wheel)


def test_our_own_echo_is_not_a_reply(bench: Bench, wheel: SerialWheel) -> None:
    """Row 12: with and without the wheel behind it: echoes are counted, readings and confirmations are the wheel's."""
    bench.fault("echo")
    assert all(samples_of(bench, wheel, 5))
    assert all(wheel.command_current(0.05).acknowledged for _ in range(5))
    assert wheel.link.damaged + wheel.link.stale >= 5
    assert wheel.link.foreign == 0
    bench.fault("echo,drop/from")
    let_pass(wheel)
    assert not any(samples_of(bench, wheel, 3))
    assert not wheel.command_current(0.1).acknowledged
    assert recovers(bench, wheel)


@pytest.mark.parametrize(("text", "counter"), [("id", "stale"), ("seq", "stale"), ("length", "damaged")])
def test_a_reply_of_another_id_seq_or_length_is_rejected(
    bench: Bench, wheel: SerialWheel, text: str, counter: str
) -> None:
    """Row 13: with a good checksum, and counted; on a bus a frame of another id is somebody else's."""
    if is_unsolicited(
        wheel
    ):  # a count that is behind by one all the time is nobody's to know; one that stands still is
        text, counter = {"id": ("id", "timeouts"), "seq": ("repeat", "stale")}.get(text, (text, counter))
    if text == "seq" and "ascii" in bench.protocol:
        pytest.skip("a line of text has no seq: what is late is told otherwise (tests/drivers/test_ascii_link.py)")
    bench.fault(text)
    let_pass(wheel)
    assert not any(samples_of(bench, wheel, 3))
    assert getattr(wheel.link, counter) >= 3
    assert recovers(bench, wheel)


@pytest.mark.parametrize(
    ("bad", "counter"),
    [
        ("flip/from:1/3", "damaged"),
        ("delay/from:60ms:1/3", "stale"),
        ("seq:1/3", "stale"),
        ("cut/from:5:1/3", "timeouts"),
    ],
)
def test_bad_replies_are_counted_dropped_and_survived(timed: Bench, bad: str, counter: str) -> None:
    """Row 8, 10, 13: every third reply to the daemon is bad: nothing wrong reaches the filter or the wheel."""
    if timed.protocol == "odrive-ascii-wheel":
        pytest.skip("a daemon needs other limits for torques")
    if "seq" in bad and timed.protocol == "ascii-wheel":
        pytest.skip("a line of text has no seq")
    ran = run(timed, 2.0, *fault(timed, 0.4, 1.4, bad))
    if timed.protocol == "can-wheel" and counter == "timeouts":
        counter = "damaged"  # the next cycle is as good
    assert getattr(ran.outcome.link, counter) >= 3
    assert ran.outcome.statistics.rejected == 0
    assert ran.outcome.zero_confirmed
    assert not ran.outcome.lost
    assert timed.registers.command_A == 0.0
    assert error_rpm(ran) < 5.0  # a flipped bit is hundreds
