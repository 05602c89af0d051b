"""Temperature and angle along a course without gaps: what effects need of them."""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.model.effect import REFERENCE_DEGC
from rw_ekf.wheel.effect_table import EffectSet

_LONG_S, _SELDOM, _LEAST_K = 10.0, 10.0, 1.0  # of a gap: seconds, usual distances of readings, change over it
_LEAST_LOGGED = 0.5  # share of samples with a value for a channel to count as logged


def is_logged(values: Float64Array) -> bool:
    """Whether a channel (n,) was logged at all."""
    return bool(np.isfinite(values).mean() >= _LEAST_LOGGED)


def filled(values: Float64Array, otherwise: float) -> tuple[Float64Array, bool]:
    """A channel with its gaps filled by the value before, and whether it was logged at all."""
    if not is_logged(values):
        return np.full(values.size, otherwise), False
    return held_over(values), True


def held_over(values: Float64Array) -> Float64Array:
    """Values (n,), each gap filled by the one before it, or the first; not all may be missing."""
    good = np.isfinite(values)
    last = np.maximum.accumulate(np.where(good, np.arange(values.size), 0))
    out: Float64Array = values[last]
    out[~np.isfinite(out)] = values[good][0]
    return out


def integrated_angle(course: Course, reference: Float64Array) -> Float64Array:
    """Angle turned since the start of each segment [rad], (n,), from a smoothed speed."""
    dt = np.diff(course.time_s)
    same = np.diff(course.segment) == 0
    turned = np.where(same, 0.5 * (reference[1:] + reference[:-1]) * dt, 0.0)
    return np.concatenate(([0.0], np.cumsum(turned)))


def bridged(values: Float64Array) -> Float64Array:
    """Readings (n,) with straight lines over gaps; not all may be missing."""
    index = np.arange(values.size)
    good = np.isfinite(values)
    return np.interp(index, index[good], values[good])


def with_conditions(course: Course) -> Course:
    """The same, temperature and angle filled; where not logged, the reference's and the readings' integral."""
    temperature, _ = filled(course.temperature_degC, REFERENCE_DEGC)
    angle, turned = filled(course.angle_rad, 0.0)
    if not turned:
        angle = integrated_angle(course, bridged(course.speed_rad_s))
    return course._replace(temperature_degC=temperature, angle_rad=angle, columns=filled_columns(course.columns))


def filled_columns(columns: Float64Array) -> Float64Array:
    """Columns (n, 3), or (0, 3), each with its gaps filled by the value before; NaN all through where there is none."""
    return np.array([filled(values, np.nan)[0] if values.size else values for values in columns.T]).T.copy()


def of_lost_temperature(time_s: Float64Array, temperature_degC: Float64Array | None, effects: EffectSet) -> list[str]:
    """What is reported of a temperature (n,) that a model goes with and a log has not, or has not for a while."""
    needing = [term.id for term in effects.terms if term.goes_with_temperature]
    if not needing:
        return []
    named = ", ".join(dict.fromkeys(needing))
    reported = np.zeros(0, dtype=int) if temperature_degC is None else np.flatnonzero(np.isfinite(temperature_degC))
    if reported.size == 0:
        return [
            f"{named} of the model goes with the temperature, which this log has not: {REFERENCE_DEGC:g} degC is taken"
        ]
    gaps = np.diff(time_s[reported])
    widest = int(np.argmax(gaps)) if gaps.size else 0
    if not gaps.size or gaps[widest] < _LONG_S or gaps[widest] < _SELDOM * float(np.median(gaps)):
        return []
    first, last = temperature_degC[reported[widest]], temperature_degC[reported[widest + 1]]  # type: ignore[index]
    if abs(last - first) < _LEAST_K:
        return []
    return [
        f"the temperature is not known from {time_s[reported[widest]]:.6g} to {time_s[reported[widest + 1]]:.6g} s, "
        f"between {first:.3g} and {last:.3g} degC: {named} goes with it, and is off there"
    ]
