"""Cyclic telemetry put together: what belongs to one moment, and what is no news."""

from __future__ import annotations

import pytest

from rw_ekf.drivers.can.can_hearing import Cycle, Fresh

A, B = {"x": 1.0}, {"y": 2.0}


def test_a_set_is_whole_when_all_of_its_messages_have_come_in_their_order() -> None:
    """Time of the first; a second cycle is another set."""
    cycle = Cycle(("a", "b"), 0.005)
    assert not cycle.add("a", A, None, 1.0)
    assert cycle.newest is None
    assert cycle.add("b", B, None, 1.002)
    first = cycle.newest
    assert first is not None
    assert (first.numbers, first.time_s) == ({"a": A, "b": B}, 1.0)
    cycle.add("a", A, None, 1.010)
    assert cycle.newest is first
    cycle.add("b", B, None, 1.012)
    assert cycle.newest is not first
    assert cycle.dropped == 0


def test_messages_of_two_cycles_are_not_put_together() -> None:
    """The second of one is lost: the first of the next begins anew; too late a second one is of no cycle."""
    cycle = Cycle(("a", "b"), 0.005)
    cycle.add("a", A, None, 1.0)
    cycle.add("b", B, None, 1.002)
    before = cycle.newest
    cycle.add("a", {"x": 2.0}, None, 1.010)  # its b is lost
    cycle.add("a", {"x": 3.0}, None, 1.020)
    assert cycle.newest is before
    assert not cycle.add("b", B, None, 1.0261)  # 6 ms behind its a
    assert cycle.newest is before
    assert cycle.dropped == 3


def test_in_a_burst_the_count_tells_the_cycles_apart() -> None:
    """All at one instant after a stall, the inner two frames lost: a1 and b2 are no set where both bear a count."""
    cycle = Cycle(("a", "b"), 0.005, same_alive=True)
    cycle.add("a", A, 1, 1.0)
    assert not cycle.add("b", B, 2, 1.0)
    assert cycle.newest is None
    cycle.add("a", A, 3, 1.0)
    assert cycle.add("b", B, 3, 1.0)


def test_a_burst_gives_its_newest_set() -> None:
    """Five cycles that come at once: the last one is what is read."""
    cycle = Cycle(("a", "b"), 0.005)
    for i in range(5):
        cycle.add("a", {"x": float(i)}, None, 1.0)
        cycle.add("b", B, None, 1.0)
    assert cycle.newest is not None
    assert cycle.newest.numbers["a"]["x"] == 4.0


def test_a_count_that_stands_still_is_no_news_for_however_long() -> None:
    """The same count again is refused, after a second too; one further is taken, and so is a lost stretch of frames."""
    fresh = Fresh(0.010, 256, 0.030)
    assert fresh.takes(b"1", 254, 0.0)
    assert not fresh.takes(b"2", 254, 0.010)
    assert not fresh.takes(b"2", 254, 1.000)
    assert fresh.takes(b"2", 255, 1.010)
    assert fresh.takes(b"2", 0, 1.020)
    assert fresh.takes(b"2", 90, 1.030)


def test_an_old_frame_is_no_news_but_a_restarted_count_is() -> None:
    """A count behind the last is an overtaken frame; once nothing newer has come for some cycles, a restart."""
    fresh = Fresh(0.010, 256, 0.030)
    assert fresh.takes(b"1", 100, 0.0)
    assert not fresh.takes(b"1", 99, 0.005)
    assert not fresh.takes(b"1", 1, 0.010)
    assert fresh.takes(b"1", 4, 0.040)


@pytest.mark.parametrize(("after_s", "taken"), [(0.0005, False), (0.007, True), (0.013, True)])
def test_without_a_count_the_same_bytes_are_new_when_their_time_has_come(after_s: float, taken: bool) -> None:
    """A duplicate comes at once; a steady wheel says the same again a period later, give or take jitter."""
    fresh = Fresh(0.010, 1, 0.030)
    assert fresh.takes(b"1", None, 0.0)
    assert fresh.takes(b"1", None, after_s) is taken
    assert fresh.takes(b"2", None, after_s + 0.0001)
