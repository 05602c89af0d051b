"""Dates without a zone as a place's clocks have them: in UTC, through summer and winter time."""

from __future__ import annotations

import datetime
from typing import TYPE_CHECKING

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.checking.wording import suggestion
from rw_ekf.errors import BadInputError

if TYPE_CHECKING:
    from zoneinfo import ZoneInfo

_QUARTER_S = 900.0  # clocks are put forward and back at quarters of an hour
_BEGIN = datetime.datetime(1970, 1, 1)


def zone_of(name: str | None) -> ZoneInfo | None:
    """The time zone of an IANA name such as Europe/Berlin. Raises BadInputError where there is none of that name."""
    if name is None:
        return None
    import zoneinfo  # few logs need it

    try:
        return zoneinfo.ZoneInfo(name)
    except (KeyError, ValueError, OSError, TypeError, AttributeError):
        known = zoneinfo.available_timezones()
        near = suggestion(name, sorted(known)) if isinstance(name, str) and known else ""
        advice = near if near.startswith("did") else "give one such as 'Europe/Berlin' or 'UTC'"
        raise BadInputError(f"time_zone: {name!r} is no time zone of the IANA database; {advice}") from None


def utc_of_local(local_s: Float64Array, zone: ZoneInfo) -> Float64Array:
    """Seconds since 1970 in UTC (n,) of a wall clock's dates in seconds as if these were UTC, (n,); NaN stays.

    Of the hour that comes twice in autumn it is the second one from where the clock falls back.
    """
    known = np.isfinite(local_s)
    wall = local_s[known]
    quarters, which = np.unique(np.floor(wall / _QUARTER_S), return_inverse=True)
    first, second = (
        np.array([_offset_s(_QUARTER_S * float(quarter), zone, fold) for quarter in quarters])[which] for fold in (0, 1)
    )
    utc = wall - first
    for begin, end in _stretches(first > second):
        fallen = np.flatnonzero(np.diff(wall[begin:end]) < -0.5 * (first - second)[begin])
        if fallen.size:
            again = slice(begin + int(fallen[0]) + 1, end)
            utc[again] = (wall - second)[again]
    found = np.full(len(local_s), np.nan)
    found[known] = utc
    return found


def _offset_s(wall_s: float, zone: ZoneInfo, fold: int) -> float:
    """What a wall clock is ahead of UTC by [s]; fold: 1 for the second time that it shows this."""
    offset = (_BEGIN + datetime.timedelta(seconds=wall_s)).replace(tzinfo=zone, fold=fold).utcoffset()
    return 0.0 if offset is None else offset.total_seconds()


def _stretches(rows: BoolArray) -> list[tuple[int, int]]:
    """Where rows (n,) are true one after another: begin and end."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
