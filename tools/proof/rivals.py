"""Three rivals of a diagnosis, fitted to its blocks: least squares, a spline over speed, a sparse regression.

Each is fitted twice: by a regression of how the smoothed speed changes over some rows (both sides smoothed alike, so
that nothing is biased by it), and from there by output error, all stretches run free. How many rows, how much
smoothing, how many rows the drive comes late (0 to 3), knots, ridge and threshold, and whether the output error is
worth it, are settled by cross-validation inside the estimation blocks: what counts is the free run over rows that
were left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from rw_ekf.arrays import BoolArray, Float64Array
from tools.proof.rival_changes import (
    Blocks,
    Changes,
    Solve,
    by_ridge,
    by_threshold,
    start_speed_rad_s,
    with_break_away,
)
from tools.proof.rival_run import run
from tools.proof.rival_terms import Terms, library, plain_terms, spline_terms

_LATE_ROWS, _LATE_S = (0, 1, 2, 3), (0.01, 0.02, 0.03, 0.05)
_WINDOWS = ((3, 1), (5, 3), (9, 5), (15, 9), (31, 15))  # rows at 100 Hz: of a change, and of the means it is between
_FINALISTS = 3  # lateness by lateness, as many as are fitted by output error too
_USUAL_HZ = 100.0
_FOLDS, _MANY = 4, 5000  # output error of so many rows is tried on halves
_STRIBECK = (0.002, 0.01, 0.04)  # of the top speed
_KNOTS, _RIDGES = (4, 8, 14), (1.0e-8, 1.0e-3)
_THRESHOLDS = (0.002, 0.005, 0.01, 0.02, 0.04, 0.08, 0.15)  # of the spread of what is explained
_TURNS = 15  # of an output-error fit


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
    plain = [_Way(plain_terms(s * top), with_break_away, f"Stribeck speed {s:g} of the top") for s in _STRIBECK]
    spline = [
        _Way(spline_terms(speed, knots), by_ridge(ridge), f"{knots} knots, ridge {ridge:g}")
        for knots, ridge in product(_KNOTS, _RIDGES)
    ]
    libraries = [library(blocks.rows, top, soft=soft) for soft in (False, True)]
    sparse = [
        _Way(terms, by_threshold(share), f"threshold {share:g}") for terms, share in product(libraries, _THRESHOLDS)
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
    entries: dict[int, tuple[float, _Way, Changes]] = {}
    for late, window in product(lates, windows):
        for terms in {id(way.terms): way.terms for way in ways}.values():
            changes = Changes.of(blocks, terms, late, window)
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


def _fitting(name: str, way: _Way, changes: Changes) -> Callable[[Blocks], Rival]:
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


def _left_out(folds: list[tuple[Blocks, Blocks]], fit: Callable[[Blocks], Rival]) -> float:
    """Root mean square of the free runs over what was left out [rad/s]."""
    squares, rows = 0.0, 0
    for rest, left in folds:
        here = int(np.isfinite(left.rows.speed_rad_s[left.fit]).sum())
        squares, rows = squares + here * fit(rest).missed_rad_s(left, left.fit) ** 2, rows + here
    return float(np.sqrt(squares / max(rows, 1)))


def _fitted(name: str, part: Blocks, way: _Way, changes: Changes) -> Rival:
    coefficients = way.solve(changes.within(part.fit))
    return Rival(name, way.terms, coefficients, changes.late_rows, part.top_rad_s, way.how)


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
