"""Temperature and angle along a course without gaps, and how often its current repeats: what effects ask of them."""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.model.effect import REFERENCE_DEGC

_LEAST_FOR_PERIOD = 40  # samples
_REPEATS = 0.98  # of the autocorrelation at no lag
_LEAST_LOGGED = 0.5  # share of samples with a value for a channel to count as logged


def filled(values: Float64Array, otherwise: float) -> tuple[Float64Array, bool]:
    """A channel with its gaps filled by the value before, and whether it was logged at all."""
    good = np.isfinite(values)
    if good.mean() < _LEAST_LOGGED:
        return np.full(values.size, otherwise), False
    last = np.maximum.accumulate(np.where(good, np.arange(values.size), 0))
    out = values[last]
    out[~np.isfinite(out)] = values[good][0]
    return out, True


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
    return course._replace(temperature_degC=temperature, angle_rad=angle)


def command_frequency(course: Course) -> float:
    """Frequency [Hz] at which the current of a log repeats itself, at least twice; 0 where it does not.

    The first lag beyond a sign change at which the autocorrelation, each lag over its own number of samples, is 0.98.
    """
    last = np.minimum(course.piece_start, course.pieces.current_A.size - 1)
    current = course.pieces.current_A[last]
    current = current - current.mean()
    n = current.size
    if n < _LEAST_FOR_PERIOD or not current.any():
        return 0.0
    power = np.abs(np.fft.rfft(current, 2 * n)) ** 2
    lags = np.fft.irfft(power)[: n // 2] / np.arange(n, n - n // 2, -1)
    level = lags / lags[0]
    crossed = np.flatnonzero(level < 0.0)
    again = np.flatnonzero(level[crossed[0] :] > _REPEATS) if crossed.size else crossed
    if again.size == 0:
        return 0.0
    first = int(crossed[0] + again[0])
    end = first + int(np.argmax(np.append(level[first:] < _REPEATS, True)))
    return float(1.0 / (course.period_s * (first + int(np.argmax(level[first:end])))))
