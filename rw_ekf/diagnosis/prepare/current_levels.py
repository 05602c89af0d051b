"""A measured current that stands at levels, with a noise of its own: what of it the machine never felt.

A drive that is given steps holds each; a sensor beside it adds a few milliamperes from row to row. Taken for what
drives the wheel they are a torque noise with a law: a motor gain that falls as one over the current, around each level,
makes of any reading there the same torque, and so takes the sensor's noise off. Healthy motors were given such a law
with .98 (docs/decisions/0056). Whether the machine felt the readings or their levels, the likelihood says.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array, by_identity
from rw_ekf.course.course import Course
from rw_ekf.likelihood.fitting import Fit, fit_model
from rw_ekf.likelihood.gauss_newton import Start
from rw_ekf.likelihood.levels import CurrentLevels
from rw_ekf.numbers import number_text

_OF_MEDIAN = 1.0 / (0.6745 * math.sqrt(2.0))  # of the size of a difference of two readings
_JUMP = 6.0  # standard deviations that two stretches differ by: noise alone does not make one of 10^6 rows in two
_SAME_LEVEL = 3.5  # standard deviations of what the means of two stretches differ by
_LEAST_ROWS = 4  # of a stretch that says by itself where its level is
_SLOPE, _FEW = 2.0, 0.1  # noises that a step has at least, and the share that may have less: a slope is many of those
_MOSTLY = 0.9  # of the rows are in such stretches
_MOST_OPEN = 24  # levels whose errors are integrated out, for what each costs
_NO_MORE = 1.1  # times the noise from row to row, that readings are off their level by: else it moves in between


@by_identity
class Levels(NamedTuple):
    """A current without its sensor's noise."""

    level_A: Float64Array  # (m,) known to noise_A over the root of how many rows stand there
    of_row: Int64Array  # (n,) at which of them it stands
    noise_A: float

    @property
    def current_A(self) -> Float64Array:
        """The current (n,) in force from each row on."""
        return self.level_A[self.of_row]


def levels_of(current_A: Float64Array, segment: Int64Array) -> Levels | None:
    """The levels (n,) that a current (n,) stands at; None where it has no noise, or does not stand.

    Stretches whose means are the same within their noise are one level: a few levels, met again and again, are known
    as well as all their readings together say.
    """
    same = np.diff(segment) == 0
    change = np.abs(np.diff(current_A))
    noise_A = _OF_MEDIAN * float(np.median(change[same])) if same.any() else 0.0
    if not noise_A > 0.0:
        return None
    begins = _begins(current_A, np.concatenate(([0], np.flatnonzero(~same) + 1)), noise_A)
    if begins.size > current_A.size / _LEAST_ROWS:
        return None
    stretch = np.searchsorted(begins, np.arange(current_A.size), side="right") - 1
    rows = np.bincount(stretch)
    long = rows >= _LEAST_ROWS
    if rows[long].sum() < _MOSTLY * current_A.size:
        return None
    mean = np.bincount(stretch, current_A) / rows
    small = (np.abs(np.diff(mean)) < _SLOPE * noise_A) & (np.diff(segment[begins]) == 0)
    if small.sum() > _FEW * rows.size:
        return None
    level = _shared(mean, rows, long, noise_A)
    level_A, of_stretch = np.unique(level, return_inverse=True)
    levels = Levels(level_A, of_stretch[stretch], noise_A)
    return levels if float(np.std(current_A - levels.current_A)) <= _NO_MORE * noise_A else None


def _begins(current_A: Float64Array, segments: Int64Array, noise_A: float) -> Int64Array:
    """Where a current (n,) leaves one level for another: each stretch is cut in two where that says most, and again.

    Of what stands at levels in between no cut says as much as one at a step [Scott & Knott 1974].
    """
    sums = np.concatenate(([0.0], np.cumsum(current_A)))
    waiting = [*zip(segments, [*segments[1:], current_A.size], strict=True)]
    found, most = [*segments], current_A.size / _LEAST_ROWS
    while waiting and len(found) <= most:  # more are no levels
        first, end = waiting.pop()
        rows, total = end - first, sums[end] - sums[first]
        left = np.arange(1, rows)
        off = (sums[first + 1 : end] - sums[first] - total * left / rows) ** 2 * rows / (left * (rows - left))
        if rows > 1 and off.max() > (_JUMP * noise_A) ** 2:
            at = first + 1 + int(off.argmax())
            found.append(at)
            waiting += [(first, at), (at, end)]
    return np.sort(np.array(found, dtype=np.int64))


def _shared(mean: Float64Array, rows: Int64Array, long: BoolArray, noise_A: float) -> Float64Array:
    """The level of each stretch (m,), from their means; of a short one that of the nearest level, if it may be that."""
    order = np.flatnonzero(long)[np.argsort(mean[long])]
    apart = np.diff(mean[order]) > _SAME_LEVEL * noise_A * np.sqrt(1.0 / rows[order][1:] + 1.0 / rows[order][:-1])
    group = np.concatenate(([0], np.cumsum(apart)))
    weight = np.bincount(group, rows[order])
    levels = np.bincount(group, rows[order] * mean[order]) / weight
    nearest = np.abs(mean[:, None] - levels).argmin(axis=1)
    off = np.abs(mean - levels[nearest])
    return np.where(off <= _SAME_LEVEL * noise_A / np.sqrt(rows) * math.sqrt(2.0), levels[nearest], mean)


def with_current(course: Course, current_A: Float64Array, delay_s: Float64Array | None) -> Course:
    """A course with another current (n,) in force."""
    moved = Course.of(course.time_s, course.speed_rad_s, current_A, delay_s, course.segment)
    return course._replace(pieces=moved.pieces, piece_start=moved.piece_start, first_piece=moved.first_piece)


def read_with(base: Fit, current_A: Float64Array, delay_s: Float64Array | None) -> Fit:
    """A model fitted to its record anew, with another current (n,) in force."""
    record = base.problem.record
    other = replace(record, course=with_current(record.course, current_A, delay_s))
    return fit_model(base.problem._replace(record=other), Start(base.model, base.trajectory, base.noise))


def at_levels(base: Fit, levels: Levels, delay_s: Float64Array) -> Fit:
    """A model fitted to its record with a current at its levels, what these are off by integrated out.

    A thousand rows of a sensor with 4 mA say where a level is to .13 mA; a speed that it drives for seconds feels less.
    """
    at = read_with(base, levels.current_A, delay_s)
    if delay_s.any() or levels.level_A.size > _MOST_OPEN:
        return at
    rows = np.bincount(levels.of_row, minlength=levels.level_A.size)
    moves = at.model.parameters.motor_gain * levels.noise_A / np.sqrt(rows)
    record = replace(at.problem.record, levels=CurrentLevels(levels.of_row, moves))
    return fit_model(at.problem._replace(record=record), Start(at.model, at.trajectory, at.noise))


def said_of(levels: Levels, gain: float, *, in_rpm: bool) -> str:
    """A sentence on a current that was taken at its levels; gain: in log-likelihood."""
    size = f"{number_text(1e3 * levels.noise_A, 2)} mA" if in_rpm else f"{number_text(levels.noise_A, 2)} A (or N, V)"
    return (
        f"the logged current has a noise of its own, {size}, around levels that the machine follows better than the "
        f"readings (by {gain:.0f} in log-likelihood): it was taken at its levels"
    )
