"""Readings on a coarse grid while the wheel keeps its speed: one error for all of them, and not known.

What rounding does to a reading depends on the speed alone. Of a speed that moves through cell after cell it is as good
as noise; of one that stays it is the same for every reading, and again whenever the wheel comes back: a thousand
readings of a staircase show no more of its steps than one of each does. So every level at which a wheel stays has an
unknown error e, and the model of docs/likelihood.md eq. 3-4 gets y - trajectory = delta + e + v. With delta + e for the
speed's error that is the chain as it was, with one regressor more for each level; it is not fitted, but integrated out:
with N (n, k) those regressors whitened, in units of their standard deviations,

    r, A  ->  (I + N N')^(-1/2) (r, A).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array
from rw_ekf.likelihood.whitening import Chain

# Readings in a row within half a cell. An error that fewer share weighs at most so many times what it should, for as
# long as the wheel stays. A third more or less of it, or of the next, names the same on six staircases of 20 to 200
# noises a step and on a slow swing through its cells.
_STAYS = 8
_MOVES_ON = 1.0 / 3.0  # of the room, from first to last third of a stay: half of what a ramp does
_MOST = 60  # levels, those of most readings: for what they cost; a staircase has some ten or twenty


@dataclass(eq=False, frozen=True)
class Levels:
    """At which level each sample is read, and how far its error may be off."""

    of_sample: Int64Array  # (n,) from 0, -1 at none
    count: int
    variance: float  # of the error at a level [rad^2/s^2]

    @classmethod
    def of(cls, speed_rad_s: Float64Array, follows: BoolArray, grid_rad_s: float, variance: float) -> Levels:
        """Of a smoothed speed (n,): the cells in which it stays, wherever it does."""
        n = speed_rad_s.size
        cells = np.full(n, np.iinfo(np.int64).max)
        for first, end in _stays(speed_rad_s, follows, 0.5 * grid_rad_s):
            cells[first:end] = round(float(np.median(speed_rad_s[first:end])) / grid_rad_s)
        found, counts = np.unique(cells[cells < np.iinfo(np.int64).max], return_counts=True)
        kept = np.sort(found[np.argsort(-counts, kind="stable")[:_MOST]])
        of_sample = np.full(n, -1)
        if kept.size:
            place = np.minimum(np.searchsorted(kept, cells), kept.size - 1)
            of_sample = np.where(kept[place] == cells, place, -1)
        return cls(of_sample, int(kept.size), variance)

    def regressors(self, chain: Chain, *, with_memory: bool) -> tuple[Float64Array, Float64Array]:
        """What one standard deviation of each level's error adds to the chain: (n, k), and to its memory, if any."""
        at = np.where(self.of_sample[:, None] == np.arange(self.count), np.sqrt(self.variance), 0.0)
        before = np.where(chain.follows[:, None], np.roll(at, 1, axis=0), 0.0)
        speed = np.where(chain.follows[:, None], at - chain.slopes[:, :1] * before, 0.0)
        memory = -chain.slopes[:, 2:3] * before
        return np.ascontiguousarray(speed), np.ascontiguousarray(memory if with_memory else memory[:0])


@dataclass(eq=False, frozen=True)
class CurrentLevels:
    """At which level the current of each interval stands, where a sensor gives these and not each row.

    A level that is off by e moves the speed by k e for as long as the wheel turns: one regressor more for each, to be
    integrated out as those above are.
    """

    of_sample: Int64Array  # (n,) that the interval stands at which a sample begins, -1 at none
    moves_rad_s2: Float64Array  # (count,) acceleration of one standard deviation of each
    unsteady_rad_s2: float = 0.0  # of the sensor's own, which an interval at none is driven with less or more

    @property
    def count(self) -> int:
        """How many there are."""
        return int(self.moves_rad_s2.size)

    def regressors(self, chain: Chain, *, with_memory: bool) -> tuple[Float64Array, Float64Array]:
        """What one standard deviation of each level adds to the chain: (n, k), and to its memory (n, k) or (0, k)."""
        before = np.roll(self.of_sample, 1)
        speed = np.where(before[:, None] == np.arange(self.count), self.moves_rad_s2 * chain.noisy_s[:, None], 0.0)
        speed[~chain.follows] = 0.0
        return np.ascontiguousarray(speed), np.zeros((speed.shape[0] if with_memory else 0, self.count))

    def variance(self, noisy_s: Float64Array) -> Float64Array:
        """Variance (n,) of what the sensor's noise adds to each interval, which moves for so long [rad^2/s^2]."""
        return np.where(np.roll(self.of_sample, 1) < 0, (self.unsteady_rad_s2 * noisy_s) ** 2, 0.0)


@dataclass(eq=False, frozen=True)
class Integrated:
    """The errors of the levels integrated out of whitened rows: (I + N N')^(-1/2), N = U s V'."""

    basis: Float64Array  # (n, k) U
    shrink: Float64Array  # (k,) 1 - (1 + s^2)^(-1/2)
    logs: float  # log-determinant of I + N N'

    @classmethod
    def of(cls, rows: Float64Array) -> Integrated:
        """Of whitened regressors N (n, k)."""
        squares, axes = np.linalg.eigh(rows.T @ rows)
        seen = squares > 1.0e-9 * max(float(squares.max(initial=0.0)), 1.0e-300)
        squares = squares[seen]
        basis = rows @ axes[:, seen] / np.sqrt(squares)
        return cls(basis, 1.0 - 1.0 / np.sqrt(1.0 + squares), float(np.sum(np.log1p(squares))))

    def taken_out(self, rows: Float64Array) -> Float64Array:
        """Whitened rows (n,) or (n, m) without what an error of a level may have done to them."""
        left: Float64Array = rows - (self.basis * self.shrink) @ (self.basis.T @ rows)
        return left


def _stays(speed_rad_s: Float64Array, follows: BoolArray, room_rad_s: float) -> list[tuple[int, int]]:
    """(first, end) of stretches of samples in which the speed stays within so much, each as long as it can be.

    None of a speed that moves on: its error changes sign within each cell, and where it crosses shows it.
    """
    edges, first = [], 0
    low = high = float(speed_rad_s[0]) if speed_rad_s.size else 0.0
    for i, speed in enumerate(speed_rad_s.tolist()):
        low, high = min(low, speed), max(high, speed)
        if high - low > room_rad_s or not follows[i]:
            edges.append((first, i))
            first, low, high = i, speed, speed
    edges.append((first, speed_rad_s.size))
    long = [(first, end) for first, end in edges if end - first >= _STAYS]
    return [at for at in long if _moved(speed_rad_s[slice(*at)]) < _MOVES_ON * room_rad_s]


def _moved(speed_rad_s: Float64Array) -> float:
    """How far the last third of a stay is from its first: two thirds of its room for a ramp."""
    third = speed_rad_s.size // 3
    return abs(float(np.median(speed_rad_s[-third:]) - np.median(speed_rad_s[:third])))
