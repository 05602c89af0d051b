"""Which current was in force when: commands turned into pieces of constant current between speed readings.

A command takes force `command_delay_s` after the reading it was computed from; until then the previous one holds
(docs/contract.md#logs). One rule, twice: over whole logs in numpy, and sample by sample online.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.wheel.interval import Pieces


def pieces_of_log(
    time_s: Float64Array, current_A: Float64Array, delay_s: Float64Array, segment: Int64Array
) -> tuple[Pieces, Int64Array]:
    """Pieces for a log of n samples (all arrays (n,)), and the first piece of each sample's interval (n,); delay >= 0.

    The interval that ends in a new segment gets no piece. Within a segment the current before the first command is
    the first command itself: nothing earlier is known.
    """
    n = time_s.size
    if n == 0:
        return Pieces(np.zeros(0), np.zeros(0), np.zeros(0)), np.zeros(0, np.int64)
    edges = np.flatnonzero(np.concatenate(([True], segment[1:] != segment[:-1], [True])))
    # A backward row is skipped; the command issued after it counts from the last valid reading, as it does online.
    if np.any(time_s[1:] < time_s[:-1]):
        time_s = np.concatenate([np.maximum.accumulate(time_s[a:b]) for a, b in pairwise(edges)])
    if not np.any(delay_s > 0.0):
        duration = np.zeros(n)
        np.subtract(time_s[1:], time_s[:-1], out=duration[:-1])
        duration[edges[1:] - 1] = 0.0  # from the last sample of a segment nothing leads on
        return Pieces(time_s, duration, np.asarray(current_A, dtype=np.float64)), np.arange(n, dtype=np.int64)
    if edges.size == 2:
        return _pieces_of_segment(time_s, current_A, delay_s)
    start = np.zeros(n, np.int64)
    found: list[Pieces] = []
    count = 0
    for a, b in pairwise(edges):
        pieces, within = _pieces_of_segment(time_s[a:b], current_A[a:b], delay_s[a:b])
        start[a:b] = within + count
        found.append(pieces)
        count += pieces.duration_s.size
    return Pieces(*(np.concatenate(values) for values in zip(*found, strict=True))), start


def _pieces_of_segment(
    time_s: Float64Array, current_A: Float64Array, delay_s: Float64Array
) -> tuple[Pieces, Int64Array]:
    # A later command that acts earlier overrides: switching times never run backwards.
    switch = np.minimum.accumulate((time_s + delay_s)[::-1])[::-1]
    if np.all(switch[:-1] >= time_s[:-1]) and np.all(switch[:-1] < time_s[1:]):
        return _pieces_of_prompt_commands(time_s, current_A, switch)
    cuts = np.concatenate((time_s, switch[(switch > time_s[0]) & (switch < time_s[-1])]))
    edges = np.unique(cuts)
    in_force = np.searchsorted(switch, edges[:-1], side="right") - 1
    current = current_A[np.maximum(in_force, 0)]
    start = np.minimum(np.searchsorted(edges, time_s), edges.size - 1).astype(np.int64)
    return Pieces(edges[:-1], np.diff(edges), current), start


def _pieces_of_prompt_commands(
    time_s: Float64Array, current_A: Float64Array, switch_s: Float64Array
) -> tuple[Pieces, Int64Array]:
    """The same where each command acts before the next reading, as nearly all do: nothing need be sorted."""
    edges = np.empty(2 * time_s.size - 1)
    edges[::2], edges[1::2] = time_s, switch_s[:-1]
    later = switch_s[:-1] > time_s[:-1]
    current = np.repeat(current_A[:-1], 2)
    current[2::2] = np.where(later[1:], current_A[:-2], current_A[1:-1])
    if later.all():
        return Pieces(edges[:-1], np.diff(edges), current), 2 * np.arange(time_s.size)
    kept = np.ones(edges.size, dtype=bool)
    kept[1::2] = later
    start, edges = (np.cumsum(kept) - 1)[::2], edges[kept]
    return Pieces(edges[:-1], np.diff(edges), current[kept[:-1]]), start


class GivenCurrents(NamedTuple):
    """The current in force, the commands that are still to act, and how late the last command was."""

    in_force_A: float
    pending: tuple[tuple[float, float], ...]  # (takes force at [s], current [A]), in order of time
    delay_s: float


def pieces_between(
    in_force_A: float, pending: Iterable[tuple[float, float]], from_s: float, to_s: float
) -> tuple[list[float], list[float]]:
    """Durations [s] and currents [A] of an interval that begins with a current in force."""
    durations: list[float] = []
    currents: list[float] = []
    at, current = from_s, in_force_A
    for acts, following in pending:
        if acts >= to_s:
            break
        if acts > at:
            durations.append(acts - at)
            currents.append(current)
            at = acts
        current = following
    durations.append(to_s - at)
    currents.append(current)
    return durations, currents


class CurrentSchedule:
    """The same rule online: commands go in as they are issued, pieces come out for each interval."""

    def __init__(self) -> None:
        self._in_force: float | None = None
        self._pending: deque[tuple[float, float]] = deque()  # (takes force at [s], current [A]), in order of time
        self._delay_s = 0.0  # of the last command

    @property
    def knows_current(self) -> bool:
        """Whether a command has been issued since the start, or the last restart."""
        return self._in_force is not None

    @property
    def in_force_A(self) -> float:
        """The current in force now [A]; 0 before any is known."""
        return 0.0 if self._in_force is None else self._in_force

    def restart(self) -> None:
        """Forget everything: a new segment, whose clock says nothing about the old one's."""
        self._in_force = None
        self._pending.clear()

    def issue(self, time_s: float, current_A: float, delay_s: float) -> None:
        """Note a command issued after the reading at `time_s`, in force from `time_s + delay_s`."""
        if self._in_force is None:
            self._in_force = current_A
        self._delay_s = max(delay_s, 0.0)
        acts = time_s + self._delay_s
        while self._pending and self._pending[-1][0] >= acts:
            self._pending.pop()
        self._pending.append((acts, current_A))

    def pieces(self, from_s: float, to_s: float) -> tuple[list[float], list[float]]:
        """Durations [s] and currents [A] of the interval; commands that came to act within it are used up."""
        found = pieces_between(self.in_force_A, self._pending, from_s, to_s)
        while self._pending and self._pending[0][0] < to_s:
            self._pending.popleft()
        self._in_force = found[1][-1]
        return found

    @property
    def given(self) -> GivenCurrents:
        """What is known of the currents from now on."""
        return GivenCurrents(self.in_force_A, tuple(self._pending), self._delay_s)
