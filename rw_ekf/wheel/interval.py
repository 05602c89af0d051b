"""What lies between two readings: pieces of constant current, and the conditions around them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from rw_ekf.arrays import by_identity
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


def warmed(acts_degC: float, read_degC: float, now_degC: float, dt_s: float, lag_s: float) -> tuple[float, float]:
    """The temperature that acts, and the one read last, dt_s after `acts_degC` did beside `read_degC`.

    A body follows its thermometer by tau dT/dt = T_read - T (docs/effects.md eq. 10), exactly where a reading holds to
    the next. now_degC: NaN where there is none. read_degC: NaN before the first of a segment, where the two are one.
    """
    if math.isnan(read_degC):
        if math.isnan(now_degC):
            return acts_degC, now_degC
        return now_degC, now_degC
    held_degC = now_degC
    if math.isnan(now_degC):
        held_degC = read_degC
    if lag_s <= 0.0:
        return held_degC, held_degC
    return read_degC + (acts_degC - read_degC) * math.exp(-dt_s / lag_s), held_degC


def last_known(before: Columns, now: Columns) -> Columns:
    """Each of them as it is, or as it was where it is not known."""
    return (
        before[0] if math.isnan(now[0]) else now[0],
        before[1] if math.isnan(now[1]) else now[1],
        before[2] if math.isnan(now[2]) else now[2],
    )


def columns_at(columns: Any, i: int) -> Columns:
    """Those of a course, (n, 3), or (0, 3) where no law asks for one."""
    if columns.shape[0] == 0:
        return math.nan, math.nan, math.nan
    return columns[i, 0], columns[i, 1], columns[i, 2]
