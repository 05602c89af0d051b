"""The temperature that acts on friction, where a bearing follows its thermometer late."""

from __future__ import annotations

import math

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.wheel.interval import UNREAD, warmed

AHEAD_SIGMA = 0.5  # of the temperature's range, by which a body may be ahead where a log begins amid a cycle


def acting_temperature(
    time_s: Float64Array, segment: Int64Array, read_degC: Float64Array, lag_s: float, ahead_K: float = 0.0
) -> Float64Array:
    """The temperature of a body that follows the one read with a time constant lag_s [s], (n,) all (docs/effects.md).

    Where the record begins the body is warmer than its thermometer by ahead_K. It goes on through rows that are lost,
    and begins anew where another clock does. Rows whose time does not go forward count for nothing, as they do to the
    filter. NaN before the first reading.
    """
    found = np.empty(time_s.size)
    body, last_s, part = UNREAD._replace(acts=math.nan, acted=math.nan), -math.inf, None
    rows = zip(time_s.tolist(), segment.tolist(), read_degC.tolist(), strict=True)
    for i, (now_s, now_part, now_degC) in enumerate(rows):
        if now_part != part or now_s > last_s:
            unknown = math.isnan(body.acts)
            body = warmed(body, now_degC, now_s - last_s if math.isfinite(last_s) else 1.0, lag_s)
            if unknown:
                body = body._replace(acts=body.acts + ahead_K, acted=body.acted + ahead_K)
            last_s, part = now_s, now_part
        found[i] = body.acts
    return found
