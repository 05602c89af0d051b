"""Currents put together from pieces in time: straight lines, or sines that come one after another for ever."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate


@dataclass(frozen=True)
class Piece:
    """A straight line from `start_A` to `end_A` [A] over `duration_s` [s]."""

    duration_s: float
    start_A: float
    end_A: float


def hold(duration_s: float, current_A: float) -> Piece:
    """Hold a current."""
    return Piece(duration_s, current_A, current_A)


def ramped(pieces: Sequence[Piece], slew_A_per_s: float) -> list[Piece]:
    """The same course without jumps: each ends where the next piece begins, climbed in the piece before it.

    The first begins from zero. Only pieces longer than the ramps they take part in can be given.
    """
    course: list[Piece] = []
    start_A = 0.0
    for index, piece in enumerate(pieces):
        slope = (piece.end_A - piece.start_A) / piece.duration_s
        rise_s = abs(piece.start_A - start_A) / slew_A_per_s
        if rise_s > 0.0:  # only the first piece of all: the others were led up to
            course.append(Piece(rise_s, start_A, piece.start_A + slope * rise_s))
        following_A = pieces[index + 1].start_A if index + 1 < len(pieces) else piece.end_A
        fall_s = abs(following_A - piece.end_A) / slew_A_per_s
        left_s = piece.duration_s - rise_s - fall_s
        level_A = piece.end_A - slope * fall_s
        course.append(Piece(left_s, piece.start_A + slope * rise_s, level_A))
        if fall_s > 0.0:
            course.append(Piece(fall_s, level_A, following_A))
        start_A = following_A
    return course


class PiecewiseLinear:
    """Pieces one after another; beyond the last one the current is zero."""

    def __init__(self, pieces: Sequence[Piece]) -> None:
        self.pieces = tuple(pieces)
        self.ends_s = tuple(accumulate(piece.duration_s for piece in self.pieces))
        self.duration_s = self.ends_s[-1]

    def current_A(self, time_s: float) -> float:
        """Current at a time from the start of the first piece."""
        index = bisect_right(self.ends_s, time_s)
        if index == len(self.pieces):
            return 0.0
        piece = self.pieces[index]
        elapsed_s = time_s - (self.ends_s[index - 1] if index else 0.0)
        return piece.start_A + (piece.end_A - piece.start_A) * elapsed_s / piece.duration_s


class DrawnCycles:
    """Cycles of random length, drawn as far as they are needed, always in the same order: so a function of time."""

    def __init__(self, draw: Callable[[], tuple[float, float]]) -> None:
        self._draw = draw  # gives (duration [s], amplitude [A]) of the next cycle
        self._ends_s: list[float] = []
        self._cycles: list[tuple[float, float]] = []

    def at(self, time_s: float) -> tuple[float, float, int]:
        """Phase within the cycle [0, 1), its amplitude [A], and its number from 0."""
        while not self._ends_s or self._ends_s[-1] <= time_s:
            cycle = self._draw()
            self._ends_s.append((self._ends_s[-1] if self._ends_s else 0.0) + cycle[0])
            self._cycles.append(cycle)
        number = bisect_right(self._ends_s, time_s)
        duration_s, amplitude_A = self._cycles[number]
        start_s = self._ends_s[number - 1] if number else 0.0
        return (time_s - start_s) / duration_s, amplitude_A, number

    def sine_A(self, time_s: float) -> float:
        """One full sine in each cycle."""
        phase, amplitude_A, _ = self.at(time_s)
        return amplitude_A * math.sin(2.0 * math.pi * phase)
