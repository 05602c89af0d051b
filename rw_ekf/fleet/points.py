"""From the days of a wheel to the points of a course: what says nothing or is far off is left out, many days are taken together."""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array
from rw_ekf.fleet.course_fit import Points
from rw_ekf.fleet.daily import WheelDays

DAYS_PER_YEAR = 365.25
_LEAST = 5  # points: fewer tell no line from what scatters about it
_KNOWS = 0.2  # of its own size: a day that does not know a parameter so well says nothing of per cents a year
_MOST = 64  # points of a fit, which takes the cube of them; a year of days in weeks loses nothing of a line
_BESIDE = 5  # days on either side that say whether one is far off
_FAR = 6.0  # robust sigmas
_LEAST_WARMTH_K = 2.0  # between the coldest and the warmest point: else temperature explains nothing


def points_of(
    days: WheelDays, parameter: str, reference_degC: float | None
) -> tuple[Points, Int64Array, Int64Array] | None:
    """The points of a parameter's course; rows (n,) where each point begins, and those left out as far off.

    reference_degC: temperature that levels are told at; None: not logged. None where there are fewer than five points.
    """
    value, std = days.values[parameter], days.stds[parameter]
    known = days.ok & np.isfinite(value) & np.isfinite(std) & (std > 0.0) & (std < _KNOWS * np.abs(value))
    rows = np.flatnonzero(known)
    if rows.size < _LEAST:
        return None
    far = far_off(value[rows], std[rows])
    left_out, rows = rows[far], rows[~far]
    warm = _warmth(days.temperature_degC[rows], reference_degC)
    if warm is not None and not np.isfinite(warm).all():
        rows, warm = rows[np.isfinite(warm)], warm[np.isfinite(warm)]
    if rows.size < _LEAST:
        return None
    time_y = (days.time_d[rows] - days.time_d[rows[0]]) / DAYS_PER_YEAR
    if time_y[-1] <= 0.0:
        return None
    points, starts = _together(time_y, value[rows], std[rows] ** 2, warm)
    return None if points.time_y.size < _LEAST else (points, rows[starts], left_out)


def far_off(value: Float64Array, std: Float64Array) -> BoolArray:
    """Days that lie far from the median of those around them, as one with a spike does: (n,)."""
    n = value.size
    padded = np.pad(value, _BESIDE, mode="edge")
    around = np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * _BESIDE + 1), axis=1)
    off = np.abs(value - around)
    scale = np.maximum(1.4826 * np.median(off), std)
    return np.asarray(off > _FAR * scale) if n > 2 * _BESIDE else np.zeros(n, dtype=bool)


def _warmth(temperature_degC: Float64Array, reference_degC: float | None) -> Float64Array | None:
    """Over the reference [K]; None where hardly any day has it, or it hardly changes."""
    known = np.isfinite(temperature_degC)
    if reference_degC is None or known.mean() < 0.8:
        return None
    if np.ptp(temperature_degC[known]) < _LEAST_WARMTH_K:
        return None
    return temperature_degC - reference_degC


def _together(
    time_y: Float64Array, value: Float64Array, variance: Float64Array, warmth_K: Float64Array | None
) -> tuple[Points, Int64Array]:
    """Means over equal spans of time, where there are more days than a fit takes."""
    n = time_y.size
    span = np.arange(n) if n <= _MOST else np.minimum((_MOST * time_y / time_y[-1]).astype(np.int64), _MOST - 1)
    starts = np.flatnonzero(np.r_[True, np.diff(span) > 0])
    scatter = 0.5 * float(np.median(np.diff(value)) ** 2) + float(np.median(np.diff(value) ** 2)) / 0.91
    weight = 1.0 / (variance + scatter)  # 0.91: median of the square of a difference of two standard normal numbers
    total = np.add.reduceat(weight, starts)

    def mean(values: Float64Array) -> Float64Array:
        return np.asarray(np.add.reduceat(weight * values, starts) / total)

    squares = np.add.reduceat(weight**2, starts) / total**2
    own = np.add.reduceat(weight**2 * variance, starts) / total**2
    return Points(mean(time_y), mean(value), own, squares, None if warmth_K is None else mean(warmth_K)), starts
