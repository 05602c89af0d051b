"""What lies between two readings: pieces of constant current, and the conditions around them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from rw_ekf.arrays import by_identity
from rw_ekf.model.effect import REFERENCE_DEGC
from rw_ekf.model.moment import NO_COLUMNS, Columns


@by_identity
class Pieces(NamedTuple):
    """Pieces of constant current in order of time; arrays over a log, lists over what the online filter remembers."""

    begin_s: Any  # (m,)
    duration_s: Any  # (m,)
    current_A: Any  # (m,)


class Interval(NamedTuple):
    """From one reading to the next: the pieces start <= j < stop lie within, those from `first` on are known."""

    from_s: float
    to_s: float
    temperature_degC: float
    angle_rad: float  # at from_s
    first: int
    start: int
    stop: int
    columns: Columns = NO_COLUMNS  # of the log, that laws of the model are functions of; at from_s


class Body(NamedTuple):
    """The temperature of what friction is in, behind a thermometer [degC]."""

    acts: float  # now
    read: float  # last; NaN before the first reading
    acted: float  # what acted when that was read
    since_s: float  # then


UNREAD = Body(REFERENCE_DEGC, math.nan, REFERENCE_DEGC, 0.0)  # what effects are relative to: none, until it is read


def interval_after(course: Any, i: int) -> Interval:
    """From sample i of a course to the next."""
    return Interval(
        course.time_s[i],
        course.time_s[i + 1],
        course.temperature_degC[i],
        course.angle_rad[i],
        course.first_piece[i],
        course.piece_start[i],
        course.piece_start[i + 1],
        columns_at(course.columns, i),
    )


def warmed(body: Body, now_degC: float, dt_s: float, lag_s: float) -> Body:
    """A body dt_s later, beside a thermometer that reads now_degC then, or nothing (no finite number).

    It follows by tau dT/dt = T_read - T (docs/effects.md eq. 10), exactly along the straight line from reading to
    reading; where one is missing, as if the last one held, until the next reads. A time that does not go forward is
    another clock's, and how long the body has been there nobody knows: it is as warm as it is read, as at first.
    """
    acts, read, acted, since = body
    if math.isnan(read) or not dt_s > 0.0:
        if not math.isfinite(now_degC):
            return Body(acts, math.nan, acts, 0.0)
        return Body(now_degC, now_degC, now_degC, 0.0)
    since = since + dt_s
    fades = 0.0
    if lag_s > 0.0:
        fades = math.exp(-since / lag_s)
    if not math.isfinite(now_degC):
        return Body(read + (acted - read) * fades, read, acted, since)
    behind = lag_s * (now_degC - read) / since
    acts = now_degC - behind + (acted - read + behind) * fades
    return Body(acts, now_degC, acts, 0.0)


def last_known(before: Columns, now: Columns) -> Columns:
    """Each of them as it is, or as it was where it is no finite number."""
    return (
        now[0] if math.isfinite(now[0]) else before[0],
        now[1] if math.isfinite(now[1]) else before[1],
        now[2] if math.isfinite(now[2]) else before[2],
    )


def columns_at(columns: Any, i: int) -> Columns:
    """Those of a course, (n, 3), or (0, 3) where no law needs one."""
    if columns.shape[0] == 0:
        return math.nan, math.nan, math.nan
    return columns[i, 0], columns[i, 1], columns[i, 2]
