"""What flowed before a record begins, and an actuator that lags or a reading that averages still remembers.

A model takes the first current for one that had flowed for long. A wheel that was given its first command with the
first row had another before: with a lag tau and a delay d an impulse k delta (G(t) - G(t')) of the difference delta is
missing between t' and t after the record's begin, G(t) = min(t, d) + tau (1 - exp(-max(t - d, 0) / tau)); readings that
are a mean over W differ by k delta (W - t)^2 / (2 W). delta is taken to be as large as the record's currents are.
"""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import state_vector
from rw_ekf.wheel.effect_table import ABSENT
from rw_ekf.wheel.window import lateness


def variance_of_past(course: Course, model: Model) -> Float64Array:
    """Variance [rad^2/s^2] of the speed's change that leads to each sample for what is not known before, (n,)."""
    table = model.effects.table()
    x = state_vector(model.coefficients, model.effects)
    delay_s = lateness(x, table)
    lag_s = max(float(x[table.lag_at]), 0.0) if table.lag_at != ABSENT else 0.0
    window_s = max(float(x[table.window_at]), 0.0) if table.window_at != ABSENT else 0.0
    if delay_s + lag_s + window_s == 0.0 or not course.pieces.current_A.size:
        return np.zeros(course.samples)
    heads = np.flatnonzero(np.diff(course.segment, prepend=course.segment[:1] - 1))
    since_s = course.time_s - np.repeat(course.time_s[heads], np.diff(heads, append=course.samples))
    missing_s = np.minimum(since_s, delay_s) - 0.5 * np.maximum(window_s - since_s, 0.0) ** 2 / max(window_s, 1.0e-300)
    if lag_s > 0.0:
        missing_s += lag_s * -np.expm1(-np.maximum(since_s - delay_s, 0.0) / lag_s)
    missing_s = np.where(since_s > 0.0, np.diff(missing_s, prepend=0.0), 0.0)
    currents = course.pieces.current_A
    first = currents[np.minimum(course.first_piece, currents.size - 1)]
    found: Float64Array = (model.parameters.motor_gain * missing_s) ** 2 * (np.mean(currents**2) + first**2)
    return found
