"""How a wheel warms up, as its own record shows it: what a prediction of its temperature needs.

A body that loses heat to its surroundings and is heated by drag and by current,

    tau dT/dt = ambient + h |omega| + g I^2 - T,

is linear in (ambient/tau, 1/tau, h/tau, g/tau) once integrated over windows; surroundings that warm up or cool down go
along as a straight line of time, held from the end of the record on.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple, Self

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course

_WINDOW_S = 10.0
_LEAST_WINDOWS = 12
_LONGEST_S, _SHORTEST_S = 3600.0, 30.0  # time constants


class Warming(NamedTuple):
    """The law of a wheel's temperature; surroundings as they were at the end of the record."""

    ambient_degC: float
    time_constant_s: float
    per_speed_K_s_rad: float  # above ambient at a steady speed
    per_current_K_A2: float  # above ambient under a steady current

    @classmethod
    def of(cls, entry: Any) -> Self | None:
        """From `ended.warming` of a diagnosis document; None where it holds none that a body can have."""
        try:
            law = cls(*(float(entry[name]) for name in cls._fields))
        except (KeyError, TypeError, ValueError, OverflowError):
            return None
        possible = law.time_constant_s > 0.0 and min(law.per_speed_K_s_rad, law.per_current_K_A2) >= 0.0
        return law if possible and all(map(math.isfinite, law)) else None

    def temperature(
        self, start_degC: float, time_s: Float64Array, speed_rad_s: Float64Array, current_A: Float64Array
    ) -> Float64Array:
        """Temperature (n,) along a motion (n,) that begins at start_degC [degC]."""
        target = self.ambient_degC + self.per_speed_K_s_rad * np.abs(speed_rad_s) + self.per_current_K_A2 * current_A**2
        keep = np.exp(-np.diff(time_s, prepend=time_s[:1]) / self.time_constant_s)
        found = np.empty(time_s.size)
        now = start_degC
        for i in range(time_s.size):
            now = target[i] + (now - target[i]) * keep[i]
            found[i] = now
        return found


def warming_of(course: Course, speed_rad_s: Float64Array) -> Warming | None:
    """Fit the law to a course with its speed (n,) without gaps; None where it is too short to show any."""
    time, temperature = course.time_s, course.temperature_degC
    per = max(round(_WINDOW_S / course.period_s), 1)
    edges = np.arange(0, time.size, per)
    if edges.size <= _LEAST_WINDOWS:
        return None
    step = np.diff(time, prepend=time[:1])
    step[np.diff(course.segment, prepend=course.segment[:1]) != 0] = 0.0
    columns = np.column_stack(
        (np.ones(time.size), time - time[-1], -temperature, np.abs(speed_rad_s), course.mean_current_A**2)
    )
    sums = np.cumsum(columns * step[:, None], axis=0)
    A = np.diff(sums[edges], axis=0)
    rise = np.diff(temperature[edges])
    kept = np.all(np.diff(course.segment[edges][:, None], axis=0) == 0, axis=1)
    A, rise = A[kept], rise[kept]
    scale = np.maximum(np.linalg.norm(A, axis=0), 1.0e-12)
    low = np.array([-np.inf, -np.inf, 1.0 / _LONGEST_S, 0.0, 0.0]) * scale
    high = np.array([np.inf, np.inf, 1.0 / _SHORTEST_S, np.inf, np.inf]) * scale
    if rise.size < _LEAST_WINDOWS:
        return None
    found = _within_bounds(A / scale, rise, low, high) / scale
    rate = float(found[2])
    return Warming(float(found[0]) / rate, 1.0 / rate, float(found[3]) / rate, float(found[4]) / rate)


def _within_bounds(A: Float64Array, b: Float64Array, low: Float64Array, high: Float64Array) -> Float64Array:
    """The least-squares solution (m,) between bounds, exactly: the best of those with some unknowns at a bound each.

    There are few unknowns, and trying which ones are held costs less than importing an optimiser.
    """
    holds = [[None, *(float(v) for v in ends if math.isfinite(v))] for ends in zip(low, high, strict=True)]
    best, least = np.clip(np.zeros(low.size), low, high), math.inf
    for held in itertools.product(*holds):
        free = np.array([value is None for value in held])
        x = np.array([0.0 if value is None else value for value in held])
        x[free] = np.linalg.lstsq(A[:, free], b - A @ x, rcond=None)[0]
        if np.all(x >= low) and np.all(x <= high):
            left = b - A @ x
            if float(left @ left) < least:
                best, least = x, float(left @ left)
    return best


def ended(course: Course, speed_rad_s: Float64Array, *, with_temperature: bool) -> dict[str, Any]:
    """How a record ended, as its diagnosis document has it: time, temperature, and how the wheel warms up."""
    stated: dict[str, Any] = {"time_s": float(course.time_s[-1]), "temperature_degC": None, "warming": None}
    if with_temperature:
        law = warming_of(course, speed_rad_s)
        stated |= {
            "temperature_degC": float(course.temperature_degC[-1]),
            "warming": None if law is None else law._asdict(),
        }
    return stated
