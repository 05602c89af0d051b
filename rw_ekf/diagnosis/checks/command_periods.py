"""A torque that is periodic in time, at a period of the command's own: what answers the command late looks like that.

The frequency of a pump or of a structure has nothing to do with the motion it is found in. By chance it meets a line of
the command as often as such lines are among all frequencies; a law with a memory that no catalogue has, of drag that
follows the speed late, say, answers at no others.
"""

from __future__ import annotations

import math

import numpy as np

from rw_ekf.course.course import Course
from rw_ekf.diagnosis.thresholds import UNNAMED_LOG_ODDS
from rw_ekf.effects.external_torque import ExternalTorque
from rw_ekf.likelihood.fitting import Fit

_LINE = 0.05  # of the current's variance, in a line's width
_OFF = 0.25  # lines' widths, that a frequency and a line found in the same record may be apart
_OCTAVES = 10.0  # in which frequencies are sought, from a period and a half in the record up


def chance_of_answer(fit: Fit, course: Course) -> float:
    """Probability that the periodic torques of a fit are answers to the command; 0 where none is at a line of it.

    Against torques whose frequencies are spread evenly in their logarithm.
    """
    frequencies = [term.shape[0] for term in fit.model.of(ExternalTorque.id) if not term.settled]
    duration = float(course.time_s[-1] - course.time_s[0])
    if not frequencies or not duration > 0.0:
        return 0.0
    lines = _lines(course)
    met = sum(any(abs(f * duration - line) < _OFF for line in lines) for f in frequencies)
    if met == 0:
        return 0.0
    by_chance = sum(math.log2((line + _OFF) / (line - _OFF)) for line in lines) / _OCTAVES
    odds = math.exp(UNNAMED_LOG_ODDS - met * math.log(by_chance))
    return odds / (1.0 + odds)


def _lines(course: Course) -> list[float]:
    """Lines of the current, in periods within the record: the tips of parabolas through the logarithms of its power."""
    even = np.linspace(course.time_s[0], course.time_s[-1], course.samples)
    current = np.interp(even, course.time_s, course.mean_current_A)
    power = np.abs(np.fft.rfft((current - current.mean()) * np.hanning(current.size))) ** 2 + 1.0e-300
    share = np.convolve(power, np.ones(3), "same") / float(power.sum())
    lines = []
    for k in range(1, power.size - 1):
        before, here, after = np.log(power[k - 1 : k + 2])
        if share[k] > _LINE and here >= max(before, after):
            lines.append(float(k + 0.5 * (before - after) / min(before - 2.0 * here + after, -1.0e-300)))
    return lines
