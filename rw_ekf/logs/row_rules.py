"""What a row must satisfy, as pure functions of arrays: segments, time order, gaps in the current, decimation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array

_NEARLY_ALL = 0.9  # of the rows: some are lost, or late
_ACCIDENTS = 0.01  # of the rows, at most
_LANDS = 10.0  # usual steps: so near to its beginning is a clock that begins anew


def segment_ids(values: Float64Array) -> Int64Array:
    """Number the segments (n,): from 0, one more wherever `values` (n,) differs from the row before."""
    ids = np.zeros(len(values), dtype=np.int64)
    np.cumsum(values[1:] != values[:-1], out=ids[1:])
    return ids


def unwrapped(time_s: Float64Array, wrap: float) -> Float64Array:
    """A clock (n,) that counts modulo `wrap` and only goes forward; 0: it does not."""
    if not wrap:
        return time_s
    turns = np.zeros(len(time_s))
    turns[1:] = np.cumsum(np.diff(time_s) < -0.5 * wrap)
    return np.asarray(time_s + wrap * turns)


def usual_step(values: Float64Array) -> float:
    """The median of the steps forth of values (n,); 0 where there are none."""
    step = np.diff(values)
    return float(np.median(step[step > 0.0])) if (step > 0.0).any() else 0.0


def is_even(values: Float64Array, within: float) -> bool:
    """Whether values (n,) rise by the usual step from row to row, within a part of it, in nine rows of ten."""
    usual = usual_step(values)
    return bool(np.mean(np.abs(np.diff(values) - usual) < within * usual) > _NEARLY_ALL)


def goes_with_seconds(seconds: Float64Array, part: Float64Array) -> bool:
    """Whether numbers (n,) rise while whole seconds stay, and fall where these advance."""
    step, anew = np.diff(part), np.diff(seconds) > 0.0
    if not anew.any() or anew.all() or not np.isfinite(step).all() or np.any(np.diff(seconds) < 0.0):
        return False
    wrong = np.count_nonzero(step[~anew] < 0.0) + np.count_nonzero(step[anew] >= 0.0)
    return bool(wrong <= _ACCIDENTS * len(step) and np.all(seconds == np.round(seconds)))


def restarted(time_s: Float64Array) -> Float64Array:
    """Number of the run (n,) where one file holds several: one more wherever time falls back to near where it began."""
    step, usual = np.diff(time_s), usual_step(time_s)
    run = np.zeros(len(time_s))
    begin = 0
    for row in np.flatnonzero(step < 0.0) + 1:
        new = time_s[row] <= time_s[begin] + _LANDS * usual and time_s[row - 1] > time_s[row] + usual * _LANDS
        if new:
            begin = int(row)
            run[row:] += 1.0
    return run


def new_rows(columns: list[Float64Array], segment: Int64Array) -> BoolArray:
    """Rows (n,) that differ from the one before in one of the columns, or begin a segment."""
    keep = np.ones(len(segment), dtype=np.bool_)
    same = segment[1:] == segment[:-1]
    for values in columns:
        same &= (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
    keep[1:] = ~same
    return keep


def spread_stamps(time_s: Float64Array, segment: Int64Array) -> Float64Array:
    """Times (n,) between coarse stamps: rows of one stamp are evenly between it and the next."""
    first = np.ones(len(time_s), dtype=np.bool_)
    first[1:] = (time_s[1:] != time_s[:-1]) | (segment[1:] != segment[:-1])
    spread = np.array(time_s)
    for number in np.unique(segment):
        inside = np.flatnonzero(segment == number)
        begins = inside[first[inside]]
        if begins.size < 3:
            continue
        if begins.size > _NEARLY_ALL * inside.size:  # stamps are not coarse: now and then two rows are within one
            step, row = np.diff(time_s[begins]), np.arange(inside.size)
            behind = row - np.maximum.accumulate(np.where(first[inside], row, 0))
            spread[inside] += float(np.min(step, where=step > 0.0, initial=np.inf)) * behind / (behind + 1.0)
            continue
        row_s = float(time_s[begins[-1]] - time_s[begins[1]]) / float(begins[-1] - begins[1])  # the first may be cut
        at = np.interp(inside, begins, time_s[begins])
        early, late = inside < begins[1], inside > begins[-1]
        at[early] = time_s[begins[1]] - row_s * (begins[1] - inside[early])
        at[late] = time_s[begins[-1]] + row_s * (inside[late] - begins[-1])
        spread[inside] = at
    return spread


def rows_in_order(time_s: Float64Array, segment: Int64Array) -> BoolArray:
    """Rows to keep (n,): those later than every row before them in their segment."""
    keep = np.ones(len(time_s), dtype=np.bool_)
    suspect = (time_s[1:] <= time_s[:-1]) & (segment[1:] == segment[:-1])
    if not suspect.any():
        return keep  # nearly every log
    for number in np.unique(segment[1:][suspect]):
        start, stop = np.searchsorted(segment, [number, number + 1])
        part = time_s[start:stop]
        keep[start + 1 : stop] = part[1:] > np.maximum.accumulate(part)[:-1]
    return keep


def held_current(current_A: Float64Array, segment: Int64Array) -> tuple[Float64Array, int]:
    """Hold the last current over gaps (n,); before the first one of a segment it is 0. Also how many those were."""
    gaps = np.isnan(current_A)
    if not gaps.any():
        return current_A, 0
    starts = np.searchsorted(segment, segment)  # first row of each row's segment
    last = np.maximum.accumulate(np.where(gaps, -1, np.arange(len(current_A))))
    leading = last < starts
    return np.where(leading, 0.0, current_A[np.maximum(last, 0)]), int(leading.sum())


def from_next_row(values: Float64Array, segment: Int64Array) -> Float64Array:
    """What the next row of the segment has (n,); its last row what it has itself."""
    taken = values.copy()
    same = segment[1:] == segment[:-1]
    taken[:-1][same] = values[1:][same]
    return taken


def decimated_rows(segment: Int64Array, every: int) -> NDArray[np.intp]:
    """Indices of every `every`-th row of each segment, its first row included."""
    row_in_segment = np.arange(len(segment)) - np.searchsorted(segment, segment)
    return np.flatnonzero(row_in_segment % every == 0)


def block_means(values: Float64Array, starts: NDArray[np.intp]) -> Float64Array:
    """Mean over each block of rows that begins at `starts` and ends before the next one; gaps are left out of it."""
    present = ~np.isnan(values)
    sums = np.add.reduceat(np.where(present, values, 0.0), starts)
    counts = np.add.reduceat(present.astype(np.float64), starts)
    means = np.full(len(starts), np.nan)
    np.divide(sums, counts, out=means, where=counts > 0)
    return means


def backward_difference(
    values: Float64Array, time_s: Float64Array, segment: Int64Array, wrap: float = 0.0
) -> Float64Array:
    """Difference to the row before over the time between them (n,); NaN in the first row of a segment.

    wrap: values begin anew after so much, and the shorter way is taken; 0: they do not.
    """
    change = np.diff(values)
    if wrap:
        change -= wrap * np.round(change / wrap)
    result = np.full(len(values), np.nan)
    inside = np.diff(segment) == 0
    with np.errstate(over="ignore"):  # a step too short for its difference gives no speed, rather than infinity
        np.divide(change, np.diff(time_s), out=result[1:], where=inside)
    result[np.isinf(result)] = np.nan
    return result
