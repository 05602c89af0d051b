"""The temperature that acts on friction, where a bearing follows its thermometer late."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.compiled import Kernel
from rw_ekf.wheel import interval as _interval
from rw_ekf.wheel.interval import UNREAD, Body, warmed

AHEAD_SIGMA = 0.5  # of the temperature's range, by which a body may be ahead where a log begins amid a cycle


def acting_temperature(
    time_s: Float64Array, segment: Int64Array, read_degC: Float64Array, lag_s: float, ahead_K: float = 0.0
) -> Float64Array:
    """The temperature of a body that follows the one read with a time constant lag_s [s], (n,) all (docs/effects.md).

    Where the record begins the body is warmer than its thermometer by ahead_K. It continues through rows that are lost,
    and begins anew where another clock does. Rows whose time does not go forward count for nothing, as they do to the
    filter. NaN before the first reading.
    """
    acts = np.empty(time_s.size)
    nobody_knows = UNREAD._replace(acts=math.nan, acted=math.nan)
    follow_pass(time_s, segment, read_degC, float(lag_s), float(ahead_K), nobody_knows, acts)
    return acts


def _follow(time_s: Any, segment: Any, read_degC: Any, lag_s: float, ahead_K: float, body: Body, acts: Any) -> None:
    """Fill `acts` (n,), from the body before the first row."""
    counts = 0  # the last row that does
    for i in range(time_s.size):
        if i == 0 or segment[i] != segment[counts] or time_s[i] > time_s[counts]:
            unknown = math.isnan(body.acts)
            body = warmed(body, read_degC[i], time_s[i] - time_s[counts], lag_s)
            if unknown:
                body = Body(body.acts + ahead_K, body.read, body.acted + ahead_K, body.since_s)
            counts = i
        acts[i] = body.acts


def _example() -> tuple[Any, ...]:
    series = np.zeros(0)
    return series, np.zeros(0, np.int64), series, 0.0, 0.0, UNREAD, series


follow_pass = Kernel(_follow, [_interval, sys.modules[__name__]], _example)
