"""A measured current that stands at levels, with a noise of its own: what of it the machine never felt.

A drive that is given steps holds each; a sensor beside it adds a few milliamperes from row to row. Taken for what
drives the wheel they are a torque noise with a law: a motor gain that falls as one over the current, around each level,
makes of any reading there the same torque, and so takes the sensor's noise off. Healthy motors were given such a law
with .98 (docs/decisions/0056). Whether the machine felt the readings or their levels, the likelihood says.

A regulated drive stands nowhere but at its limits, where a set-point that is far away keeps it for seconds. There the
sensor's noise makes such a law as well; elsewhere it is a torque noise of a known size, and of these rows alone.
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
_RUN = 8  # rows in a row that say by themselves that a drive stands at its limit
_HIGHEST, _FEWEST = 0.02, 20  # share and number of the highest runs, among which a limit is sought
_PILED = 4.0  # times as many runs at a limit as right below it: what only comes near to its largest has no such pile
_BEYOND = 0.002  # of the runs may be beyond a limit
_LIMITED = 0.05  # of the rows are at limits: fewer make no law
_TURNS = 3
_NO_MORE = 1.1  # times the noise from row to row, that readings are off their level by: else it moves in between


@by_identity
class Levels(NamedTuple):
    """A current without its sensor's noise."""

    level_A: Float64Array  # (m,) known to noise_A over the root of how many rows stand there
    of_row: Int64Array  # (n,) at which of them it stands, -1 at none
    noise_A: float
    current_A: Float64Array  # (n,) in force from each row on: its level, as it was read at none

    @property
    def rows(self) -> Int64Array:
        """How many rows stand at each (m,)."""
        return np.bincount(self.of_row[self.of_row >= 0], minlength=self.level_A.size)


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
    level_A = np.unique(level[long])  # what a short stretch has for itself is no level, and as unsure as its rows
    place = np.minimum(np.searchsorted(level_A, level), level_A.size - 1)
    of_row = np.where(level_A[place] == level, place, -1)[stretch]
    levels = Levels(level_A, of_row, noise_A, np.where(of_row >= 0, level_A[of_row], current_A))
    return levels if float(np.std(current_A - levels.current_A)) <= _NO_MORE * noise_A else None


def limits_of(current_A: Float64Array, segment: Int64Array) -> Levels | None:
    """The limits that a regulated current (n,) is held at for a while; None where it has no noise there, or no limit.

    A limit is where runs of rows are piled up, with none beyond, and scatter about it as from row to row.
    """
    if current_A.size < _RUN + _FEWEST:
        return None
    sums, squares = (np.concatenate(([0.0], np.cumsum(values))) for values in (current_A, current_A**2))
    mean = (sums[_RUN:] - sums[:-_RUN]) / _RUN
    variance = np.maximum((squares[_RUN:] - squares[:-_RUN]) / _RUN - mean**2, 0.0) * _RUN / (_RUN - 1)
    whole = segment[_RUN - 1 :] == segment[: current_A.size - _RUN + 1]
    of_row = np.full(current_A.size, -1, dtype=np.int64)
    levels: list[float] = []
    errors: list[Float64Array] = []
    for sign in (-1.0, 1.0):
        found = _limit(sign * mean[whole], variance[whole])
        if found is None:
            continue
        level, noise_A = sign * found[0], found[1]
        near = np.abs(current_A - level) < _SAME_LEVEL * noise_A * math.sqrt(2.0)
        runs = whole & (np.abs(mean - level) < _SAME_LEVEL * noise_A / math.sqrt(_RUN))
        runs &= np.convolve(near, np.ones(_RUN), "valid") > _RUN - 0.5
        begun = np.concatenate((runs, np.zeros(_RUN - 1, dtype=bool)))
        at = np.convolve(begun, np.ones(_RUN))[: current_A.size] > 0.5
        between = at[1:] & at[:-1]
        from_row_to_row = float(np.std(np.diff(current_A)[between])) / math.sqrt(2.0) if between.any() else 0.0
        off = current_A[at] - np.mean(current_A[at]) if at.any() else np.zeros(1)
        if 0.0 < float(np.std(off)) <= _NO_MORE * from_row_to_row:
            of_row[at] = len(levels)
            levels.append(float(np.mean(current_A[at])))
            errors.append(off)
    if not levels or np.mean(of_row >= 0) < _LIMITED:
        return None
    level_A = np.array(levels)
    return Levels(
        level_A, of_row, float(np.std(np.concatenate(errors))), np.where(of_row >= 0, level_A[of_row], current_A)
    )


def _limit(mean: Float64Array, variance: Float64Array) -> tuple[float, float] | None:
    """Where runs (m,) of a current are piled up at its largest, and the noise there [A]; None: nowhere."""
    if mean.size < _FEWEST:
        return None
    highest = np.argsort(-mean)[: max(_FEWEST, round(_HIGHEST * mean.size))]
    level, noise = float(np.median(mean[highest])), math.sqrt(float(np.median(variance[highest])))
    room = 0.0
    for _ in range(_TURNS):
        room = _SAME_LEVEL * noise / math.sqrt(_RUN)
        at = np.abs(mean - level) < room
        if at.sum() < _FEWEST or not noise > 0.0:
            return None
        level, noise = float(np.median(mean[at])), math.sqrt(float(np.median(variance[at])))
    at, below = np.abs(mean - level) < room, np.abs(mean - level + 2.0 * room) < room
    if np.mean(mean > level + 2.0 * room) > _BEYOND or at.sum() < _PILED * below.sum():
        return None
    return level, noise


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
    gain = at.model.parameters.motor_gain
    shared = CurrentLevels(levels.of_row, gain * levels.noise_A / np.sqrt(levels.rows), gain * levels.noise_A)
    record = replace(at.problem.record, levels=shared)
    return fit_model(at.problem._replace(record=record), Start(at.model, at.trajectory, at.noise))


def sentence_about(levels: Levels, gain: float, *, in_rpm: bool) -> str:
    """A sentence on a current that was taken at its levels; gain: in log-likelihood."""
    size = f"{number_text(1e3 * levels.noise_A, 2)} mA" if in_rpm else f"{number_text(levels.noise_A, 2)} A (or N, V)"
    if np.mean(levels.of_row >= 0) < _MOSTLY:
        limits = " and ".join(f"{number_text(level, 3)} A" for level in levels.level_A)
        return (
            f"the logged current has a noise of its own, {size}: where the drive stands at its limit ({limits}) it was "
            "taken at that, and elsewhere the noise for a torque noise that is known"
        )
    return (
        f"the logged current has a noise of its own, {size}, around levels that the machine follows better than the "
        f"readings (by {gain:.0f} in log-likelihood): it was taken at its levels"
    )
