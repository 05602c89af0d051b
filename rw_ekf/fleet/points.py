"""From the days of a wheel to the points of a course: what says nothing, or is far off, is left out.

A course of many days is fitted to means over equal spans; none of them reaches over a day at which a step was found.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array
from rw_ekf.fleet.course_fit import ANY_WALK, CourseFit, Points, fit_course
from rw_ekf.fleet.daily import WheelDays

DAYS_PER_YEAR = 365.25
LEAST_POINTS = 5  # fewer show no line beside what scatters about it
KNOWS = 0.2  # of its own size: a day that does not know a parameter so well says nothing of per cents a year
_MOST = 64  # points of a fit, which takes the cube of them; a year of days in weeks loses nothing of a line
_BESIDE = 5  # days on either side that say whether one is far off
_FAR = 6.0  # robust sigmas
_GAP = 0.5  # of the span of the eleven nearest: a day beyond a longer gap has nothing beside it
_APART_K, _PAIRED = 1.0, 400  # of two days that say what a kelvin does; days at most, for the pairs are its square
_LEAST_WARMTH_K = 2.0  # between the coldest and the warmest day: else temperature explains nothing
_ROUNDS = 3  # in which steps are found and their days sought
_NORMAL_SQUARE = 0.4549  # median of the square of a standard normal number


@dataclass(eq=False, frozen=True)
class KnownDays:
    """The n days of a wheel that say something of a parameter."""

    rows: Int64Array  # (n,) of the wheel's days
    far_off: Int64Array  # rows that were left out
    far_by: Float64Array  # of each of these, of the size of what is around it
    time_y: Float64Array  # (n,) since the first [years]
    value: Float64Array
    variance: Float64Array
    warmth_K: Float64Array | None  # over the fleet's own temperature


@dataclass(eq=False, frozen=True)
class Course:
    """A fitted course: its points, and for each of them the first of the wheel's rows in it."""

    known: KnownDays
    points: Points
    starts: Int64Array
    fit: CourseFit


def course_of(
    days: WheelDays, parameter: str, reference_degC: float | None, walks: Float64Array = ANY_WALK
) -> Course | None:
    """The course of a parameter; None where fewer than five days know it.

    reference_degC: temperature at which levels are stated; None: not logged. walks: see `fit_course`.
    """
    known = known_days(days, parameter, reference_degC)
    if known is None:
        return None
    breaks: list[int] = []
    for _ in range(_ROUNDS):
        points, starts = _points(known, breaks)
        if points.time_y.size < LEAST_POINTS:
            return None
        fit = fit_course(points, walks)
        sought = sorted({_day_of_step(known, starts, fit, step.before) for step in fit.steps})
        if sought == breaks or points.time_y.size == known.rows.size:
            break
        breaks = sought
    return Course(known, points, known.rows[starts], fit)


def known_days(days: WheelDays, parameter: str, reference_degC: float | None) -> KnownDays | None:
    """The days that know a parameter and are not far off; None where they are fewer than five, or of one moment."""
    value, std = days.values[parameter], days.stds[parameter]
    known = days.ok & np.isfinite(value) & np.isfinite(std) & (std > 0.0)
    rows = np.flatnonzero(known)
    rows = rows[std[rows] < KNOWS * np.abs(value[rows])]
    if rows.size < LEAST_POINTS:
        return None
    warmth = _warmth(days.temperature_degC[rows], reference_degC)
    like_others = value[rows] if warmth is None else value[rows] - _per_K(value[rows], warmth) * warmth
    off, far = far_off(like_others, std[rows], days.time_d[rows])
    left_out, far_by, rows = rows[far], (off / np.abs(like_others - off))[far], rows[~far]
    if warmth is not None:
        warmth = warmth[~far]
        reported = np.isfinite(warmth)
        rows, warmth = rows[reported], warmth[reported]
    if rows.size < LEAST_POINTS or days.time_d[rows[-1]] <= days.time_d[rows[0]]:
        return None
    time_y = (days.time_d[rows] - days.time_d[rows[0]]) / DAYS_PER_YEAR
    return KnownDays(rows, left_out, far_by, time_y, value[rows], std[rows] ** 2, warmth)


def far_off(value: Float64Array, std: Float64Array, time_d: Float64Array) -> tuple[Float64Array, BoolArray]:
    """By how much each day is off the median of the eleven around it, and whether that is far, as with a spike: (n,).

    At an end the eleven nearest days stand for those around. There a course that falls or rises is followed by a line,
    a day beyond a long gap is not judged, and of days running that are far to one side none is odd: a wheel that fails
    is off by more each day.
    """
    n, reach = value.size, 2 * _BESIDE + 1
    if n < reach:
        return np.zeros(n), np.zeros(n, dtype=bool)
    first = np.clip(np.arange(n) - _BESIDE, 0, n - reach)
    around = np.lib.stride_tricks.sliding_window_view(value, reach)[first]
    off = value - np.median(around, axis=1)
    least = _FAR * np.maximum(1.4826 * np.median(np.abs(off)), std)
    far = np.abs(off) > least
    side = np.where(far, np.sign(off), 0.0)
    beside = (side == np.r_[0.0, side[:-1]]) | (side == np.r_[side[1:], 0.0])
    for near in (slice(0, reach), slice(n - reach, n)):
        ends = np.arange(_BESIDE) if near.start == 0 else np.arange(n - _BESIDE, n)
        line = _robust_line(time_d[near], value[near], time_d[ends])
        judged = ~beside[ends] & ~_beyond_gap(time_d[near], outwards=-1 if near.start == 0 else 1)
        far[ends] &= judged & (np.abs(value[ends] - line) > least[ends])
    return off, far


def _beyond_gap(time_d: Float64Array, outwards: int) -> BoolArray:
    """Of the days at the outer end of a window: whether a gap lies between them and all behind them, (_BESIDE,)."""
    gaps = np.diff(time_d)
    long = gaps > _GAP * (time_d[-1] - time_d[0])
    if outwards > 0:
        return np.asarray(np.logical_or.accumulate(long)[-_BESIDE:])
    return np.asarray(np.logical_or.accumulate(long[::-1])[::-1][:_BESIDE])


def _robust_line(time_d: Float64Array, value: Float64Array, at_d: Float64Array) -> Float64Array:
    """The line of Theil and Sen through values, at other times: the median of all slopes between two of them."""
    one, other = np.triu_indices(value.size, 1)
    apart = time_d[other] > time_d[one]
    slope = float(np.median((value[other] - value[one])[apart] / (time_d[other] - time_d[one])[apart]))
    return np.asarray(slope * at_d + np.median(value - slope * time_d))


def _per_K(value: Float64Array, warmth_K: Float64Array) -> float:
    """What a kelvin does, by the median of all pairs of days that are a kelvin apart; none of them: nothing."""
    rows = np.linspace(0, value.size - 1, min(value.size, _PAIRED)).astype(int)
    one, other = np.triu_indices(rows.size, 1)
    change, apart = np.diff(value[rows][[one, other]], axis=0)[0], np.diff(warmth_K[rows][[one, other]], axis=0)[0]
    told = np.abs(apart) > _APART_K
    return float(np.median(change[told] / apart[told])) if told.any() else 0.0


def _warmth(temperature_degC: Float64Array, reference_degC: float | None) -> Float64Array | None:
    """Over the reference [K]; None where hardly any day has it, or it hardly changes."""
    known = np.isfinite(temperature_degC)
    if reference_degC is None or known.mean() < 0.8 or np.ptp(temperature_degC[known]) < _LEAST_WARMTH_K:
        return None
    return temperature_degC - reference_degC


def _points(known: KnownDays, breaks: Sequence[int]) -> tuple[Points, Int64Array]:
    """Means over equal spans where there are more days than a fit takes; a span ends before each of `breaks`."""
    n = known.rows.size
    share = known.time_y / known.time_y[-1]
    span = np.arange(n) if n <= _MOST else np.minimum((_MOST * share).astype(np.int64), _MOST - 1)
    starts = np.flatnonzero(np.r_[True, np.diff(span) > 0])
    ends = np.r_[:_BESIDE, n - _BESIDE : n] if n > _MOST else starts  # a step may lie a day or two from an end
    starts = np.unique(np.r_[starts, ends, np.array(breaks, dtype=np.int64)])
    scatter = 0.5 * float(np.median(np.diff(known.value) ** 2)) / _NORMAL_SQUARE
    weight = 1.0 / (known.variance + scatter)
    total = np.add.reduceat(weight, starts)

    def mean(values: Float64Array) -> Float64Array:
        return np.asarray(np.add.reduceat(weight * values, starts) / total)

    points = Points(
        time_y=mean(known.time_y),
        value=mean(known.value),
        variance=np.add.reduceat(weight**2 * known.variance, starts) / total**2,
        share=np.add.reduceat(weight**2, starts) / total**2,
        spread_y=_spreads(known.time_y, weight, starts),
        now_y=float(known.time_y[-1]),
        warmth_K=None if known.warmth_K is None else mean(known.warmth_K),
    )
    return points, starts


def _spreads(time_y: Float64Array, weight: Float64Array, starts: Int64Array) -> Float64Array:
    """Half the mean distance between two days of each span, by weight: so much less varies the mean of a walk, (n,)."""
    found = np.zeros(starts.size)
    for place, (first, end) in enumerate(itertools.pairwise([*starts, time_y.size])):
        w, t = weight[first:end] / weight[first:end].sum(), time_y[first:end]
        found[place] = 0.5 * float(w @ np.abs(np.subtract.outer(t, t)) @ w)
    return found


def _day_of_step(known: KnownDays, starts: Int64Array, fit: CourseFit, before: int) -> int:
    """The first day after a step that lies between two points: where two levels fit the days around it best."""
    ends = np.append(starts[1:], known.rows.size)
    low, high = int(starts[max(before - 1, 0)]), int(ends[min(before + 2, len(ends) - 1)])
    value = known.value[low:high] - fit.rate * known.time_y[low:high]
    if known.warmth_K is not None and fit.per_K is not None:
        value = value - fit.per_K * known.warmth_K[low:high]
    n = value.size
    if n < 2:
        return int(starts[before + 1])
    left = np.arange(1, n)
    sums = np.cumsum(value)[:-1]
    gained = sums**2 / left + (value.sum() - sums) ** 2 / (n - left)
    return low + int(left[np.argmax(gained)])
