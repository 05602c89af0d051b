"""Time as a loop has it: the computer's, or a clock that passes only while somebody waits for it."""

from __future__ import annotations

import heapq
import itertools
import select
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Protocol

_PATIENCE_S = 30.0  # longer than any disk that works; one that does not must end a test, not hang it


class Clock(Protocol):
    """What the loop and the drivers take time from."""

    def monotonic(self) -> float:
        """Time since some instant [s]; never steps."""
        ...

    def sleep(self, seconds: float, unless: int | None = None) -> None:
        """Wait; no longer than until the descriptor `unless` is readable."""
        ...

    def patience_s(self, budget_s: float) -> float:
        """How long, by the computer's time [s], a loop waits for another thread that it would give budget_s [s]."""
        ...

    def utc(self) -> datetime:
        """The hour of the day."""
        ...


class SystemClock:
    """The computer's own time."""

    def monotonic(self) -> float:
        """Time since some instant [s]; never steps."""
        return time.monotonic()

    def sleep(self, seconds: float, unless: int | None = None) -> None:
        """Wait; no longer than until the descriptor `unless` is readable."""
        select.select([] if unless is None else [unless], [], [], max(seconds, 0.0))

    def patience_s(self, budget_s: float) -> float:
        """The budget itself: this is the computer's time."""
        return budget_s

    def utc(self) -> datetime:
        """The hour of the day."""
        return datetime.now(UTC)


class VirtualClock:
    """Hours of a loop in seconds, the same every time: a wait is over at once, and the time is then what it would be.

    What else shall happen, happens in a wait: see `at`.
    """

    def __init__(self, began: datetime = datetime(2000, 1, 1, tzinfo=UTC)) -> None:
        self._began = began
        self._now_s = 0.0
        self._order = itertools.count()
        self._events: list[tuple[float, int, Callable[[], object]]] = []

    def at(self, time_s: float, action: Callable[[], object]) -> None:
        """Call `action` as soon as this clock shows time_s [s]; equal times in the order they were given."""
        heapq.heappush(self._events, (time_s, next(self._order), action))

    def monotonic(self) -> float:
        """Time since the clock was made [s]."""
        return self._now_s

    def sleep(self, seconds: float, unless: int | None = None) -> None:
        """Let the time pass; no further than to the event that made the descriptor `unless` readable."""
        end_s = self._now_s + max(seconds, 0.0)
        while self._events and self._events[0][0] <= end_s:
            time_s, _, action = heapq.heappop(self._events)
            self._now_s = max(self._now_s, time_s)
            action()
            if unless is not None and select.select([unless], [], [], 0.0)[0]:
                return
        self._now_s = end_s

    def patience_s(self, budget_s: float) -> float:
        """Half a minute: hours pass here in seconds, in which a disk has no time to keep up, and waiting costs none."""
        return max(budget_s, _PATIENCE_S)

    def utc(self) -> datetime:
        """The hour of the day, counted from when the clock was made."""
        return self._began + timedelta(seconds=self._now_s)
