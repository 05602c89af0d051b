"""The guard before a sink: what a broken, a slow or a hanging one costs the loop, and what is said of it."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import pytest

from rw_ekf.clock import Clock, SystemClock, VirtualClock
from rw_ekf.records import Tick, WheelSample
from rw_ekf.sinks import guarded_sink
from rw_ekf.sinks.guarded_sink import GuardedSink, Queue
from rw_ekf.sinks.run_files import Unwritten
from tests.live.daemon import Notes
from tests.ticks import tick_of


class Taker:
    """A sink that keeps the times it was given, fails at some, and takes none while `held`."""

    def __init__(self, *fails_at: float) -> None:
        self.taken: list[float] = []
        self.lost_before: list[tuple[int, int]] = []  # (ticks taken so far, ticks lost then)
        self.closed = 0
        self.let_go = threading.Event()
        self.let_go.set()
        self._fails_at = fails_at

    def write(self, tick: Tick) -> None:
        self.let_go.wait(10.0)
        if tick.sample.time_s in self._fails_at:
            raise RuntimeError("no")
        self.taken.append(tick.sample.time_s)

    def lost(self, ticks: int) -> None:
        self.lost_before.append((len(self.taken), ticks))

    def close(self) -> None:
        self.closed += 1


def guarded(sink: Taker, queue: Queue | None, clock: Clock) -> tuple[GuardedSink, Unwritten, Notes]:
    unwritten, notes = Unwritten(), Notes()
    return GuardedSink("taker", sink, queue, clock, unwritten, notes.error), unwritten, notes


def feed(sink: GuardedSink, *times: float) -> None:
    for time_s in times:
        sink.write(tick_of(WheelSample(time_s, 1.0)))


@pytest.mark.parametrize("queue", [None, Queue(8)])
def test_failures_are_counted_and_said_once_and_the_rest_is_taken(queue: Queue | None) -> None:
    """Two of five ticks make the sink raise: one line of log, two counted, three taken, closed once."""
    taker = Taker(1.0, 3.0)
    sink, unwritten, notes = guarded(taker, queue, VirtualClock())
    feed(sink, 0.0, 1.0, 2.0, 3.0, 4.0)
    sink.close()
    sink.close()
    assert taker.taken == [0.0, 2.0, 4.0]
    assert notes.events == ["sink_failed"]
    assert unwritten.failed_sinks == {"taker": 2}
    assert unwritten
    assert taker.closed == 1


def test_a_sink_that_hangs_costs_the_loop_its_budget_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The queue fills, one turn waits for the budget, the ticks beyond are lost, and the sink is told where."""
    monkeypatch.setattr(guarded_sink, "_BUDGET_S", 0.3)
    taker = Taker()
    taker.let_go.clear()
    sink, _, _ = guarded(taker, Queue(4, lost=taker.lost), SystemClock())
    feed(sink, 0.0)
    while sink._waiting:  # the thread has taken the first, and hangs with it
        time.sleep(0.001)
    began_s = time.monotonic()
    feed(sink, *(float(i) for i in range(1, 40)))
    assert 0.3 <= time.monotonic() - began_s < 5.0  # once, not 35 times
    taker.let_go.set()
    while sink._waiting:
        time.sleep(0.001)
    feed(sink, 40.0)
    sink.close()
    assert taker.taken == [0.0, 1.0, 2.0, 3.0, 4.0, 40.0]
    assert taker.lost_before == [(5, 35)]


def test_hours_in_seconds_wait_for_a_disk_that_is_slow() -> None:
    """On a virtual clock a full queue waits for its sink, however slow: each tick is taken and no time passes."""
    taker, clock = Taker(), VirtualClock()
    taker.let_go.clear()
    sink, _, _ = guarded(taker, Queue(2, lost=taker.lost), clock)
    slow = threading.Timer(3.0 * guarded_sink._BUDGET_S, taker.let_go.set)
    slow.start()
    feed(sink, *(float(i) for i in range(40)))
    sink.close()
    assert taker.taken == [float(i) for i in range(40)]
    assert taker.lost_before == []
    assert clock.monotonic() == 0.0


def test_a_sink_that_never_comes_back_does_not_hold_the_end_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Closing waits its time and no longer; what still waited counts as lost."""
    monkeypatch.setattr(guarded_sink, "_CLOSE_WITHIN_S", 0.05)
    taker = Taker()
    taker.let_go.clear()
    sink, _, _ = guarded(taker, Queue(8, lost=taker.lost), VirtualClock())
    feed(sink, 0.0)
    while sink._waiting:
        time.sleep(0.001)
    feed(sink, 1.0, 2.0)
    sink.close()
    assert taker.lost_before == [(0, 2)]
    assert taker.closed == 0
    taker.let_go.set()


def test_a_sink_of_the_newest_gets_one_now_and_then_and_the_last() -> None:
    """Every second of the run's clock the tick of that moment, those between are no loss, the last one always."""
    taker, clock = Taker(), VirtualClock()
    sink, unwritten, _ = guarded(taker, Queue(1, every_s=1.0), clock)
    for i in range(27):
        feed(sink, 0.125 * i)
        while sink._is_due:  # until the thread has it
            time.sleep(0.001)
        clock.sleep(0.125)
    sink.close()
    assert taker.taken == [0.0, 1.0, 2.0, 3.0, 3.25]
    assert not unwritten


def test_a_sink_takes_turns_without_a_sample_only_where_it_is_to() -> None:
    """Three turns, one of them without a sample: an ordinary sink is handed two, one of every turn all three."""
    for every_turn, taken in ((False, [0.0, 2.0]), (True, [0.0, 1.0, 2.0])):
        taker = Taker()
        sink = GuardedSink("taker", taker, None, VirtualClock(), Unwritten(), Notes().error, every_turn=every_turn)
        for time_s in (0.0, 1.0, 2.0):
            sink.write(replace(tick_of(WheelSample(time_s, 1.0)), fresh=time_s != 1.0))
        assert taker.taken == taken
