"""What lies between two readings: pieces of constant current, and the conditions around them."""

from __future__ import annotations

from typing import Any, NamedTuple

from rw_ekf.arrays import by_identity


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
    )
