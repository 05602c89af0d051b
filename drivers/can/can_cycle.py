"""Frames that nobody asked for, put together: of each set of messages the newest that belongs to one moment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

_SOONEST = 0.25  # of a period: the same bytes again within it are the same frame again


class Told(NamedTuple):
    """What the messages of one moment said."""

    numbers: Mapping[str, Mapping[str, float]]  # by message and signal
    time_s: float  # when the first of them came, by the host's monotonic clock


class Fresh:
    """Whether each frame of one message is a new one: its count moves on, or there is none and its time does."""

    def __init__(self, period_s: float, alive_span: int, missing_after_s: float) -> None:
        self._period_s = period_s
        self._span = alive_span
        self._missing_s = missing_after_s
        self._last: tuple[bytes, int | None, float] | None = None

    def takes(self, data: bytes, alive: int | None, time_s: float) -> bool:
        """Whether it is; one that stands still, or counts back while others come, is not."""
        if self._last is not None:
            before, count, at_s = self._last
            if alive is None or count is None:
                if data == before and time_s - at_s < _SOONEST * self._period_s:
                    return False
            else:
                ahead = (alive - count) % self._span
                if ahead == 0 or (ahead > self._span // 2 and time_s - at_s < self._missing_s):
                    return False
        self._last = (data, alive, time_s)
        return True


class Cycle:
    """The messages of one moment, in the order in which they are sent.

    A set begins with the first message, and the others must follow in their order, within a time of it; where the map
    says so, with the same count. Anything else is of another cycle, and what is left without its rest is dropped.
    """

    def __init__(self, messages: tuple[str, ...], within_s: float, *, same_alive: bool = False) -> None:
        self._messages = messages
        self._within_s = within_s
        self._same_alive = same_alive
        self._begun: list[tuple[Mapping[str, float], int | None, float]] = []
        self.newest: Told | None = None
        self.dropped = 0  # frames whose cycle never was whole

    def add(self, message: str, numbers: Mapping[str, float], alive: int | None, time_s: float) -> bool:
        """Take one fresh frame; whether it made a set whole."""
        at = self._messages.index(message)
        if at != len(self._begun) or not self._belongs(alive, time_s):
            if self.newest is not None:  # the first look falls into the middle of a cycle
                self.dropped += len(self._begun) + (at != 0)
            self._begun.clear()
            if at != 0:
                return False
        self._begun.append((numbers, alive, time_s))
        if len(self._begun) < len(self._messages):
            return False
        told = {name: part[0] for name, part in zip(self._messages, self._begun, strict=True)}
        self.newest = Told(told, self._begun[0][2])
        self._begun.clear()
        return True

    def _belongs(self, alive: int | None, time_s: float) -> bool:
        if not self._begun:
            return True
        _, first_alive, first_s = self._begun[0]
        return time_s - first_s <= self._within_s and not (self._same_alive and alive != first_alive)
