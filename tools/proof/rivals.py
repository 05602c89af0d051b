"""Three rivals of a diagnosis, fitted to its blocks: least squares, a spline over speed, a sparse regression.

Each is fitted twice: by a regression of how the smoothed speed changes over some rows (both sides smoothed alike, so
that nothing is biased by it), and from there by output error, all stretches run free. How many rows, how much
smoothing, how many rows the drive comes late (0 to 3), knots, ridge and threshold, and whether the output error is
worth it, are settled by cross-validation inside the estimation blocks: what counts is the free run over rows that
were left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from rw_ekf.arrays import BoolArray, Float64Array
from tools.proof.rival_run import run
from tools.proof.rival_terms import Rows, Terms, library, plain_terms, spline_terms

_LATE_ROWS, _LATE_S = (0, 1, 2, 3), (0.01, 0.02, 0.03, 0.05)
_WINDOWS = ((3, 1), (5, 3), (9, 5), (15, 9), (31, 15))  # rows at 100 Hz: of a change, and of the means it is between
_FINALISTS = 3  # lateness by lateness, as many as are fitted by output error too
_USUAL_HZ = 100.0
_FOLDS, _MANY = 4, 5000  # output error of so many rows is tried on halves
_STRIBECK = (0.002, 0.01, 0.04)  # of the top speed
_KNOTS, _RIDGES = (4, 8, 14), (1.0e-8, 1.0e-3)
_THRESHOLDS = (0.002, 0.005, 0.01, 0.02, 0.04, 0.08, 0.15)  # of the spread of what is explained
_TURNS = 15  # of an output-error fit
_ROUNDS = 10  # of thresholding
_NOTHING = 1.0e-9  # of the largest column: a term that the record never meets
_ASIDE = 1.0e-10  # a ridge that only keeps what the record says nothing of at zero


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


@dataclass(eq=False, frozen=True)
class Rival:
    """A fitted rival."""

    name: str
    terms: Terms
    coefficients: Float64Array
    late_rows: int
    top_rad_s: float
    how: str  # what cross-validation settled

    def run(self, blocks: Blocks, part: BoolArray) -> Float64Array:
        """Free runs of the stretches in a part (n,), (n,) [rad/s]; elsewhere the speed stands."""
        driven = self.terms.driven(blocks.rows, self.coefficients, self.late_rows)
        driven = driven._replace(step_s=driven.step_s * part, early_s=driven.early_s * part)
        return run(driven, self.terms.friction(self.coefficients, self.top_rad_s), blocks.begins, blocks.start_rad_s)

    def missed_rad_s(self, blocks: Blocks, part: BoolArray) -> float:
        """Root mean square by which readings of a part (n,) are missed."""
        error = (self.run(blocks, part) - blocks.rows.speed_rad_s)[part]
        return float(np.sqrt(np.nanmean(error**2)))


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
class _Way:
    """Terms and a way to solve for them, one of those that cross-validation chooses among."""

    terms: Terms
    solve: Solve
    how: str


def fitted_rivals(blocks: Blocks) -> list[Rival]:
    """The three, in the order of the module's first line."""
    top = blocks.top_rad_s
    speed = blocks.rows.speed_rad_s[blocks.fit & np.isfinite(blocks.rows.speed_rad_s)]
    plain = [_Way(plain_terms(s * top), _with_break_away, f"Stribeck speed {s:g} of the top") for s in _STRIBECK]
    spline = [
        _Way(spline_terms(speed, knots), _ridge(ridge), f"{knots} knots, ridge {ridge:g}")
        for knots, ridge in product(_KNOTS, _RIDGES)
    ]
    libraries = [library(blocks.rows, top, soft=soft) for soft in (False, True)]
    sparse = [
        _Way(terms, _thresholded(share), f"threshold {share:g}") for terms, share in product(libraries, _THRESHOLDS)
    ]
    named = {"least squares": plain, "spline over speed": spline, "sparse regression": sparse}
    return [_chosen(name, blocks, ways) for name, ways in named.items()]


def _chosen(name: str, blocks: Blocks, ways: list[_Way]) -> Rival:
    """The way that predicts best what it was not fitted to, fitted to all estimation rows."""
    folds, halves = list(_folds(blocks)), list(_folds(blocks, 2 if int(blocks.fit.sum()) > _MANY else _FOLDS))
    period_s = float(np.median(blocks.rows.step_s()[blocks.rows.step_s() > 0.0]))
    finer = max(1, round(1.0 / (_USUAL_HZ * period_s)))
    lates = sorted({*_LATE_ROWS, *(round(late / period_s) for late in _LATE_S)})
    windows = [(finer * length, finer * (width - 1) + 1) for length, width in _WINDOWS]
    entries: dict[int, tuple[float, _Way, _Changes]] = {}
    for late, window in product(lates, windows):
        for terms in {id(way.terms): way.terms for way in ways}.values():
            changes = _Changes.of(blocks, terms, late, window)
            for way in (way for way in ways if way.terms is terms):
                score = _left_out(folds, _fitting(name, way, changes))
                if late not in entries or score < entries[late][0]:
                    entries[late] = score, way, changes
    best: tuple[float, Callable[[Blocks], Rival], str] | None = None
    for _, way, changes in sorted(entries.values(), key=lambda entry: entry[0])[:_FINALISTS]:
        fit = _fitting(name, way, changes)
        how = f"{way.how}, {changes.late_rows} rows late, changes over {changes.length} rows"
        for one, by in ((fit, "regression"), (_refined(fit), "output error")):
            score = _left_out(halves, one)
            if best is None or score < best[0]:
                best = score, one, f"{how}, {by}"
    assert best is not None
    return replace(best[1](blocks), how=best[2])


def _fitting(name: str, way: _Way, changes: _Changes) -> Callable[[Blocks], Rival]:
    return lambda part: _fitted(name, part, way, changes)


def _refined(fit: Callable[[Blocks], Rival]) -> Callable[[Blocks], Rival]:
    return lambda part: _by_output_error(fit(part), part)


def _folds(blocks: Blocks, count: int = _FOLDS) -> Iterator[tuple[Blocks, Blocks]]:
    """The estimation rows in `count` pieces of time: all but one to fit, and the one left out."""
    place = np.cumsum(blocks.fit) - 1
    piece = np.where(blocks.fit, place * count // max(int(blocks.fit.sum()), 1), -1)
    edge = np.diff(piece, prepend=piece[:1] - 1) != 0
    begins = blocks.begins | edge
    start = blocks.start_rad_s.copy()
    for i in np.flatnonzero(edge & ~blocks.begins):
        start[i] = start_speed_rad_s(blocks.rows, int(i))
    for number in range(count):
        inside = replace(blocks, begins=begins, start_rad_s=start)
        yield replace(inside, fit=blocks.fit & (piece != number)), replace(inside, fit=piece == number)


def start_speed_rad_s(rows: Rows, first: int, count: int = 9) -> float:
    """Speed at a row by a straight line through the readings from there on."""
    here = slice(first, min(first + count, rows.time_s.size))
    time, speed = rows.time_s[here] - rows.time_s[first], rows.speed_rad_s[here]
    good = np.isfinite(speed) & (rows.segment[here] == rows.segment[first])
    if good.sum() < 3:
        return float(speed[good][0]) if good.any() else 0.0
    return float(np.polyfit(time[good], speed[good], 1)[1])


def _left_out(folds: list[tuple[Blocks, Blocks]], fit: Callable[[Blocks], Rival]) -> float:
    """Root mean square of the free runs over what was left out [rad/s]."""
    squares, rows = 0.0, 0
    for rest, left in folds:
        here = int(np.isfinite(left.rows.speed_rad_s[left.fit]).sum())
        squares, rows = squares + here * fit(rest).missed_rad_s(left, left.fit) ** 2, rows + here
    return float(np.sqrt(squares / max(rows, 1)))


@dataclass(eq=False, frozen=True)
class _Changes:
    """How the speed changes over some rows, and what each term has by then, both averaged over rows alike."""

    late_rows: int
    length: int
    speed: Float64Array  # (n,) averaged
    columns: Float64Array  # (n, p) integrated from the stretch's begin, averaged
    stretch: Float64Array  # (n,) which one a row belongs to
    known: dict[int, tuple[BoolArray, Normal]] = field(default_factory=dict)  # by id of the part

    @classmethod
    def of(cls, blocks: Blocks, terms: Terms, late_rows: int, window: tuple[int, int]) -> _Changes:
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


def _fitted(name: str, part: Blocks, way: _Way, changes: _Changes) -> Rival:
    coefficients = way.solve(changes.within(part.fit))
    return Rival(name, way.terms, coefficients, changes.late_rows, part.top_rad_s, way.how)


def _with_break_away(normal: Normal) -> Float64Array:
    """The four-parameter model; where break-away would be no friction, or one that nothing shows, without it."""
    kept = np.ones(normal.scale.size, dtype=bool)
    found = normal.solved(kept, _ASIDE) / normal.scale
    if not 3.0 * found[-2] < found[-1] < 0.0:  # slowing is negative
        kept[-1] = False
        found = normal.solved(kept, _ASIDE) / normal.scale
    return found


def _ridge(ridge: float) -> Solve:
    return lambda normal: normal.solved(np.ones(normal.scale.size, dtype=bool), ridge) / normal.scale


def _thresholded(share: float) -> Solve:
    """Least squares again and again without the terms that contribute less than a share of the changes' size."""

    def solve(normal: Normal) -> Float64Array:
        kept = np.ones(normal.scale.size, dtype=bool)
        out = np.zeros(kept.size)
        for _ in range(_ROUNDS):
            out = normal.solved(kept, _ASIDE)
            small = kept & (np.abs(out) < share * normal.size)
            if not small.any() or small.sum() == kept.sum():
                break
            kept &= ~small
        return out / normal.scale

    return solve


def _by_output_error(rival: Rival, part: Blocks) -> Rival:
    """The same terms with coefficients by which the free runs of the rows to fit come nearest to the readings."""
    used = np.flatnonzero(rival.coefficients != 0.0)
    good = part.fit & np.isfinite(part.rows.speed_rad_s)
    if used.size == 0:
        return rival

    def with_values(values: Float64Array) -> Rival:
        coefficients = np.zeros(rival.coefficients.size)
        coefficients[used] = values
        return replace(rival, coefficients=coefficients)

    def missed(values: Float64Array) -> Float64Array:
        return np.asarray(with_values(values).run(part, part.fit)[good] - part.rows.speed_rad_s[good])

    first = rival.coefficients[used]
    found = least_squares(missed, first, x_scale=np.abs(first) + 1.0e-9, diff_step=1.0e-4, max_nfev=_TURNS)
    return with_values(found.x) if found.cost < 0.5 * float(np.sum(missed(first) ** 2)) else rival
