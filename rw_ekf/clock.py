"""Time as a loop has it: the computer's, or a clock that passes only while somebody waits for it."""

from __future__ import annotations

import heapq
import itertools
import math
import select
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Protocol

_ROUNDING_S = 1e-6  # far below any period: sums of periods are not exact
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


class Slot:
    """The part of each period that is one wheel's, where several share a line: one silent in it has had its turn.

    So a wheel that does not answer costs the others one time-out a period, however often its own loop would poll again.
    """

    def __init__(self, clock: Clock, period_s: float, phase_s: float) -> None:
        """phase_s: where in the period it begins."""
        self.period_s = period_s
        self._clock = clock
        self._origin_s = clock.monotonic() + phase_s
        self._again_s = -math.inf

    @property
    def may_ask(self) -> bool:
        """Whether nobody has been waited for in vain since it began last."""
        return self._clock.monotonic() >= self._again_s - _ROUNDING_S

    def give_up(self) -> None:
        """Somebody was waited for in vain."""
        self._again_s = self.next_s()

    def take_up(self) -> None:
        """Let it be queried at once: what it is waited for is worth the others' time."""
        self._again_s = -math.inf

    def wake_s(self, time_s: float) -> float:
        """When whoever waits until a time [s] to poll again had better do so: not before it begins again."""
        return max(time_s, self._again_s)

    def next_s(self) -> float:
        """When it begins next [s], by the clock."""
        return self._origin_s + self.period_s * (self.number() + 1)

    def number(self) -> int:
        """Of the period that it is in now, or was last."""
        return math.floor((self._clock.monotonic() - self._origin_s + _ROUNDING_S) / self.period_s)


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
