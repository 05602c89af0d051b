"""The guard before every sink: what a slow or a broken one may cost the loop, which is next to nothing."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from rw_ekf.clock import Clock
from rw_ekf.records import Sink, StateNow, Tick
from rw_ekf.sinks.run_files import Note, Unwritten

_BUDGET_S = 0.02  # for which a turn waits for a queue that is full; once, until there is room again
_CLOSE_WITHIN_S = 5.0
_LOOK_EVERY_S = 0.2  # how long a tick may wait in a queue that is not half full


class Queue(NamedTuple):
    """How a sink that may be slow gets its ticks: in a thread of its own."""

    ticks: int  # as many may wait
    every_s: float = 0.0  # above 0: the newest tick alone, so often by the run's clock, at a change of state, the last
    lost: Callable[[int], None] = lambda ticks: None  # given how many were lost before the tick that comes next
    at_once: bool = False  # each tick wakes the thread, which costs the turn some 20 us
    waits: bool = True  # whether a turn waits for room, up to its budget


class GuardedSink:
    """A sink whose exceptions are counted and reported once, and whose slowness stays its own. Control continues."""

    def __init__(
        self,
        name: str,
        sink: Sink,
        queue: Queue | None,
        clock: Clock,
        unwritten: Unwritten,
        note: Note,
        *,
        every_turn: bool = False,
    ) -> None:
        """queue: None where the sink takes its ticks within the turn. every_turn: also those without a sample."""
        self.name = name
        self._every_turn = every_turn
        self._sink = sink
        self._rule = queue
        self._clock = clock
        self._unwritten = unwritten
        self._note = note
        self._waiting: deque[tuple[int, Tick]] = deque()  # (ticks lost before it, tick)
        self._lost = 0
        self._behind = False
        self._due_s = 0.0
        self._state: StateNow | None = None  # that was handed over last
        self._is_due = self._closing = self._closed = False
        self._wake = threading.Condition()
        self._thread: threading.Thread | None = None
        if queue is not None:
            self._thread = threading.Thread(target=self._serve, args=(queue,), name=f"sink-{name}", daemon=True)
            self._thread.start()

    @property
    def behind(self) -> int:
        """Ticks that wait."""
        return len(self._waiting)

    def write(self, tick: Tick) -> None:
        """Hand a tick over, if it is one for this sink. Never raises."""
        if not (tick.fresh or self._every_turn):
            return
        if self._rule is None:
            self._guarded(lambda: self._sink.write(tick))
        elif self._rule.every_s > 0.0:
            now = self._clock.monotonic()
            with self._wake:
                self._waiting.clear()
                self._waiting.append((0, tick))
                if now >= self._due_s or tick.state is not self._state:
                    self._due_s, self._is_due = now + self._rule.every_s, True
                    self._state = tick.state
                    self._wake.notify_all()
        else:
            self._put(tick, self._rule)

    def close(self) -> None:
        """Let what waits be written, and finish the sink; one that hangs is left alone after five seconds."""
        if self._closed:
            return
        self._closed = True
        if self._thread is not None and self._rule is not None:
            with self._wake:
                self._closing = True
                self._wake.notify_all()
            self._thread.join(_CLOSE_WITHIN_S)
            self._lost += len(self._waiting)
            if self._lost:
                self._rule.lost(self._lost)
            if self._thread.is_alive():
                return
        self._guarded(self._sink.close)

    def _put(self, tick: Tick, rule: Queue) -> None:
        most = rule.ticks
        with self._wake:
            if len(self._waiting) >= most and not self._behind:
                patience_s = self._clock.patience_s(_BUDGET_S) if rule.waits else 0.0
                self._behind = not self._wake.wait_for(lambda: len(self._waiting) < most, patience_s)
            if len(self._waiting) >= most:
                self._lost += 1
                return
            self._behind = False
            self._waiting.append((self._lost, tick))
            self._lost = 0
            if (
                len(self._waiting) > most // 2 or rule.at_once
            ):  # else it looks by itself: to wake it costs the turn more
                self._is_due = True
                self._wake.notify_all()

    def _serve(self, rule: Queue) -> None:
        newest_alone = rule.every_s > 0.0
        while not (self._closing and not self._waiting):
            with self._wake:
                self._wake.wait_for(lambda: self._closing or self._is_due, None if newest_alone else _LOOK_EVERY_S)
                self._is_due = False
            while self._waiting:
                with self._wake:
                    lost, tick = self._waiting.popleft()
                    self._wake.notify_all()
                if lost:
                    rule.lost(lost)
                self._guarded(lambda tick=tick: self._sink.write(tick))  # type: ignore[misc]
                if newest_alone:
                    break

    def _guarded(self, work: Callable[[], None]) -> None:
        try:
            work()
        except Exception as error:  # noqa: BLE001 - whatever it is: the wheel is driven on
            failed = self._unwritten.failed_sinks
            failed[self.name] = failed.get(self.name, 0) + 1
            if failed[self.name] == 1:
                reason = f"{type(error).__name__}: {error}"
                self._unwritten.note(reason)
                self._note("sink_failed", sink=self.name, reason=reason, do="the run goes on, and counts how often")
