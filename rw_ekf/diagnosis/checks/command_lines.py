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
_SEARCHED = 600  # lines' widths: nearly all frequencies at which a periodic torque is sought
_EITHER_SIDE = 1.0  # lines' widths, in which a frequency is that of a line


def chance_of_answer(fit: Fit, course: Course) -> float:
    """Probability that the periodic torques of a fit are answers to the command; 0 where none is at a line of it."""
    frequencies = [term.shape[0] for term in fit.model.of(ExternalTorque.id) if not term.settled]
    duration = float(course.time_s[-1] - course.time_s[0])
    if not frequencies or not duration > 0.0:
        return 0.0
    lines = _lines(course)
    met = sum(any(abs(f * duration - line) <= _EITHER_SIDE for line in lines) for f in frequencies)
    if met == 0:
        return 0.0
    by_chance = min((2.0 * _EITHER_SIDE + 1.0) * len(lines) / _SEARCHED, 1.0)
    odds = math.exp(UNNAMED_LOG_ODDS - met * math.log(by_chance))
    return odds / (1.0 + odds)


def _lines(course: Course) -> list[int]:
    """Lines of the current, in periods within the record."""
    even = np.linspace(course.time_s[0], course.time_s[-1], course.samples)
    current = np.interp(even, course.time_s, course.mean_current_A)
    power = np.abs(np.fft.rfft((current - current.mean()) * np.hanning(current.size))) ** 2
    share = np.convolve(power, np.ones(3), "same") / max(float(power.sum()), 1.0e-300)
    return [k for k in range(1, power.size - 1) if share[k] > _LINE and power[k] == power[k - 1 : k + 2].max()]
