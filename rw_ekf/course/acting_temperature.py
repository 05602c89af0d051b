"""The temperature that acts on friction, where a bearing follows its thermometer late."""

from __future__ import annotations

import math

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.wheel.interval import warmed


def acting_temperature(
    time_s: Float64Array, segment: Int64Array, read_degC: Float64Array, lag_s: float, ahead_K: float = 0.0
) -> Float64Array:
    """The temperature of a body that follows the one read with a time constant lag_s [s], (n,) all (docs/effects.md).

    Where a segment begins the two are one, but that the body is warmer by ahead_K where the record begins. A reading
    that is missing (NaN) is as it was; NaN before the first one. Rows whose time does not go forward count for nothing,
    as they do to the filter.
    """
    found = np.empty(time_s.size)
    acts, read, last_s, part = math.nan, math.nan, -math.inf, None
    rows = zip(time_s.tolist(), segment.tolist(), read_degC.tolist(), strict=True)
    for i, (now_s, now_part, now_degC) in enumerate(rows):
        if now_part != part:
            read, part, last_s = math.nan, now_part, -math.inf
        if now_s > last_s:
            unknown = math.isnan(acts)
            acts, read = warmed(acts, read, now_degC, now_s - last_s, lag_s)
            acts += ahead_K if unknown else 0.0
            last_s = now_s
        found[i] = acts
    return found
