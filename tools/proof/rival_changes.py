"""What a rival is fitted to: how the speed changes over some rows, as normal equations, and ways to solve them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, by_identity
from tools.proof.rival_terms import Rows, Terms

_ROUNDS = 10  # of thresholding
_NOTHING = 1.0e-9  # of the largest column: a term that the record never meets
ASIDE = 1.0e-10  # a ridge that only keeps what the record says nothing of at zero


@dataclass(eq=False, frozen=True)
class Blocks:
    """Rows and which of them a rival may be fitted to; a stretch is run free from where it `begins`."""

    rows: Rows
    fit: BoolArray  # (n,)
    begins: BoolArray  # (n,)
    start_rad_s: Float64Array  # (n,) the speed from which a stretch begins, where it does

    @property
    def top_rad_s(self) -> float:
        """Top speed of the rows to fit."""
        speed = np.abs(self.rows.speed_rad_s[self.fit])
        return float(np.nanmax(speed))


@by_identity
class Normal(NamedTuple):
    """Normal equations of a regression, the columns scaled to a mean square of one."""

    gram: Float64Array  # (p, p), means over rows
    moment: Float64Array  # (p,)
    scale: Float64Array  # (p,) of the columns
    size: float  # root mean square of the changes

    def solved(self, kept: BoolArray, ridge: float) -> Float64Array:
        """Coefficients (p,) of the scaled columns, of those kept (p,)."""
        out = np.zeros(kept.size)
        gram = self.gram[np.ix_(kept, kept)]
        out[kept] = np.linalg.solve(gram + ridge * np.eye(gram.shape[0]), self.moment[kept])
        return out


Solve = Callable[[Normal], Float64Array]  # -> coefficients (p,)


@dataclass(eq=False, frozen=True)
class Changes:
    """How the speed changes over some rows, and what each term has by then, both averaged over rows alike."""

    late_rows: int
    length: int
    speed: Float64Array  # (n,) averaged
    columns: Float64Array  # (n, p) integrated from the stretch's begin, averaged
    stretch: Float64Array  # (n,) which one a row belongs to
    known: dict[int, tuple[BoolArray, Normal]] = field(default_factory=dict)  # by id of the part

    @classmethod
    def of(cls, blocks: Blocks, terms: Terms, late_rows: int, window: tuple[int, int]) -> Changes:
        """Of all rows; window: over how many rows a change is taken, and how many are averaged."""
        rows = blocks.rows
        stretch = np.cumsum(blocks.begins).astype(np.float64)
        length, width = window
        known = np.isfinite(rows.speed_rad_s)
        speed = np.interp(np.arange(known.size), np.flatnonzero(known), rows.speed_rad_s[known])
        smooth = _averaged(speed[:, None], stretch, width)[:, 0]
        columns = terms.columns(rows, smooth, late_rows) * rows.step_s()[:, None]
        integral = np.cumsum(columns, axis=0) - columns
        both = _averaged(np.column_stack((speed, integral)), stretch, width)
        return cls(late_rows, length, both[:, 0], both[:, 1:], stretch)

    def within(self, part: BoolArray) -> Normal:
        """Normal equations of the changes that lie within a part (n,) of the rows; worked out once a part."""
        if id(part) not in self.known:
            first = np.flatnonzero(part[: -self.length])
            last = first + self.length
            whole = part[last] & (self.stretch[first] == self.stretch[last])
            first, last = first[whole], last[whole]
            columns, change = self.columns[last] - self.columns[first], self.speed[last] - self.speed[first]
            scale = np.sqrt(np.mean(columns**2, axis=0))
            scale = np.where(scale > _NOTHING * np.max(scale), scale, np.inf)
            unit, rows = columns / scale, max(first.size, 1)
            size = float(np.sqrt(np.mean(change**2)))
            self.known[id(part)] = part, Normal(unit.T @ unit / rows, unit.T @ change / rows, scale, size)
        return self.known[id(part)][1]


def _averaged(values: Float64Array, stretch: Float64Array, width: int) -> Float64Array:
    """Centred means over `width` rows of values (n, p), over fewer near the ends of a stretch."""
    if width <= 1:
        return values
    at = np.arange(stretch.size)
    first = np.searchsorted(stretch, stretch, side="left")
    last = np.searchsorted(stretch, stretch, side="right") - 1
    half = np.minimum(np.minimum(width // 2, at - first), last - at)
    total = np.concatenate((np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)))
    return np.asarray((total[at + half + 1] - total[at - half]) / (2 * half + 1)[:, None])


def with_break_away(normal: Normal) -> Float64Array:
    """The four-parameter model; where break-away would be no friction, or one that nothing shows, without it."""
    kept = np.ones(normal.scale.size, dtype=bool)
    found = normal.solved(kept, ASIDE) / normal.scale
    if not 3.0 * found[-2] < found[-1] < 0.0:  # slowing is negative
        kept[-1] = False
        found = normal.solved(kept, ASIDE) / normal.scale
    return found


def by_ridge(ridge: float) -> Solve:
    """Ridge regression of the scaled columns."""
    return lambda normal: normal.solved(np.ones(normal.scale.size, dtype=bool), ridge) / normal.scale


def by_threshold(share: float) -> Solve:
    """Least squares again and again without the terms that contribute less than a share of the changes' size."""

    def solve(normal: Normal) -> Float64Array:
        kept = np.ones(normal.scale.size, dtype=bool)
        out = np.zeros(kept.size)
        for _ in range(_ROUNDS):
            out = normal.solved(kept, ASIDE)
            small = kept & (np.abs(out) < share * normal.size)
            if not small.any() or small.sum() == kept.sum():
                break
            kept &= ~small
        return out / normal.scale

    return solve


def start_speed_rad_s(rows: Rows, first: int, count: int = 9) -> float:
    """Speed at a row by a straight line through the readings from there on."""
    here = slice(first, min(first + count, rows.time_s.size))
    time, speed = rows.time_s[here] - rows.time_s[first], rows.speed_rad_s[here]
    good = np.isfinite(speed) & (rows.segment[here] == rows.segment[first])
    if good.sum() < 3:
        return float(speed[good][0]) if good.any() else 0.0
    return float(np.polyfit(time[good], speed[good], 1)[1])
