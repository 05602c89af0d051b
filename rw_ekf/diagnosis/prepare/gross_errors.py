"""Readings that no wheel can have: they are left out before anything is fitted, and counted (docs/diagnosis.md)."""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array

_NOISES = 15.0  # of the readings beside their neighbours' median
_CHANGES = 4.0  # of the change from sample to sample that nine in ten stay below
_AT_EDGES = 3.0  # times as far: a ramp leaves the median of neighbours on one side
_MOST_SHARE = 0.1  # more than so many are no errors but the record itself
_NOISE_OF_MEDIAN = 1.0 / 0.6745


def gross_errors(speed_rad_s: Float64Array, segment: Int64Array) -> BoolArray:
    """Readings (n,) far from the median of the five around them, within a segment; NaN is none.

    A median of five follows a ramp and a corner exactly, and two wrong readings in a row leave it where it was. Far
    means beyond what the noise does and beyond what the wheel's own changes are; none where too many would be.
    """
    n = speed_rad_s.size
    wrong = np.zeros(n, dtype=bool)
    good = np.flatnonzero(np.isfinite(speed_rad_s))
    if good.size < 5:
        return wrong
    speed = speed_rad_s[good]
    block = np.cumsum(np.diff(segment[good], prepend=segment[good][:1]) != 0)
    first, last = np.searchsorted(block, block, side="left"), np.searchsorted(block, block, side="right") - 1
    begin = np.clip(np.arange(good.size) - 2, first, np.maximum(last - 4, first))
    around = np.minimum(begin[:, None] + np.arange(5), last[:, None])
    off = np.abs(speed - np.median(speed[around], axis=1))
    edge = begin != np.arange(good.size) - 2
    noise = _NOISE_OF_MEDIAN * float(np.median(off))
    changes = np.abs(np.diff(speed))[np.diff(block) == 0]
    usual = float(np.quantile(changes, 0.9)) if changes.size else 0.0
    found = off > max(_NOISES * noise, _CHANGES * usual) * np.where(edge, _AT_EDGES, 1.0)
    if found.mean() <= _MOST_SHARE:
        wrong[good[found]] = True
    return wrong
