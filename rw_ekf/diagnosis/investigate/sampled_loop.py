"""Rows that hold the current of a moment, of a controller that acts between them.

A speed controller answers the noise of each reading: I = ... - a v, with v of the reading in the same row. A controller
that keeps step with the log drives the wheel with all of it until the next row, and every likelihood here holds as it
stands, because a reading comes after the current that leads to it. One that is faster has forgotten the reading a
hundredth of a second later: between rows the wheel is driven with less of v, a torque that is alien to the model and
goes with the reading's noise. A fit follows it with torque noise, which takes the readings' noise for less than it is
(two numbers, innovations white: nothing of second order distinguishes them), and viscous friction, laws of the current
and knocks of what the controller did meanwhile come out of it.

So what of the current answers the readings is taken off, and the mean of a row and the next put in its place. Where
the controller is faster, torque noise falls (in logs at a fifth and a tenth of its rate to .14 to .84), and the
readings' noise rises to what it is. In step with the log the wheel did feel what was taken off, and neither is so: of
54 such logs with effects twice as large as are named, half with a sensor's noise in the current, none was reported,
of 60 healthy ones none. A controller that hardly answers leaves no more than a current that is half a row late
(`late_rows.py`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array, by_identity
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.prepare.current_levels import read_with
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.logs.row_rules import from_next_row
from rw_ekf.numbers import number_text

_FEWEST = 100  # rows that show how the current answers
_GROSS = 5.0  # noises: a step of the set-point
_MEDIAN = 1.4826
_OVERLAP = 1.5  # second differences of neighbouring rows share readings: of the variance of what they show
_ANSWERS = 10.0  # standard deviations
_SHARE, _MOST = 0.1, 2.0  # of the torque noise, that one reading's noise makes: in step with the log it is 7 and more
_FALLS, _RISES = 0.85, 1.03  # to what the torque noise falls and the readings' rises, were it so


@by_identity
class Answer(NamedTuple):
    """How a current answers the noise of the reading in its row."""

    along_A: float  # current less for a reading that is 1 rad/s more [A/(rad/s)]
    std: float
    free: BoolArray  # (n,) rows in which the controller is at no limit

    @property
    def is_certain(self) -> bool:
        """Whether it answers at all."""
        return self.along_A > _ANSWERS * self.std


def answer_of(current_A: Float64Array, noise_rad_s: Float64Array, segment: Int64Array) -> Answer:
    """Of the noises of readings (n,), NaN where there is none: by second differences, which a motion hardly has."""
    free = np.zeros(current_A.size, dtype=bool)
    change = np.diff(current_A) != 0.0
    free[1:-1] = change[1:] & change[:-1] & (segment[2:] == segment[:-2])
    free &= (current_A < current_A.max()) & (current_A > current_A.min())
    current, noise = (values[1:-1] - 0.5 * (values[:-2] + values[2:]) for values in (current_A, noise_rad_s))
    reported = free[1:-1] & free[:-2] & free[2:] & np.isfinite(noise)
    if reported.sum() < _FEWEST:
        return Answer(0.0, math.inf, free)
    reported &= np.abs(current) < _GROSS * _MEDIAN * float(np.median(np.abs(current[reported])))
    squares = float(noise[reported] @ noise[reported])
    if reported.sum() < _FEWEST or not squares > 0.0:
        return Answer(0.0, math.inf, free)
    along = float(noise[reported] @ current[reported]) / squares
    left = current[reported] - along * noise[reported]
    return Answer(-along, math.sqrt(_OVERLAP * float(np.mean(left**2)) / squares), free)


def between_rows(prepared: Prepared) -> tuple[Fit, float] | None:
    """The base model with the mean current between rows, as a faster controller leaves it, and how it answers.

    None where the current does not answer the readings, or the torque noise is not of the size that it makes. Twice,
    because a fit that takes the readings' noise for torque noise follows half of it.
    """
    base, course, found = prepared.base, prepared.record.course, 0.0
    fit = base
    for _ in range(2):
        noise = course.speed_rad_s - fit.trajectory.speed
        answer = answer_of(prepared.current_A, noise, course.segment)
        moved = base.model.parameters.motor_gain * course.period_s * answer.along_A
        share = float(np.mean(answer.free)) * moved**2 / max(base.noise.ratio, 1.0e-300)
        if not answer.is_certain or not _SHARE < share < _MOST:
            return None
        without = prepared.current_A + np.where(answer.free, answer.along_A * np.nan_to_num(noise), 0.0)
        fit = read_with(base, 0.5 * (without + from_next_row(without, course.segment)), None)
        found = answer.along_A
    return fit, found


def stated_of_sampled_loop(found: Found) -> str:
    """A sentence for the front of a verdict, or nothing."""
    prepared = found.prepared
    if prepared.source.log.command_delay_s.any():  # who logs these knows when a command takes force
        return ""
    read = between_rows(prepared)
    if read is None:
        return ""
    fit, along_A = read
    before, after = prepared.base.noise, fit.noise
    falls = after.ratio * after.variance < _FALLS * before.ratio * before.variance
    if not (falls and after.variance > _RISES * before.variance):
        return ""
    return (
        "The log's current seems to be that of a moment, of a controller that is faster than the log: it answers the "
        f"noise of the reading in its row, by {number_text(along_A, 2)} A per rad/s, and the wheel does not feel that "
        "until the next. Parameters and what is named may be off by it: log the mean of the current from row to row, "
        "or each turn of the controller, and diagnose again. As it was read: "
    )
