"""The facts of a log that the catalogue of effects asks for."""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import BoolArray
from rw_ekf.course.course import Course
from rw_ekf.diagnosis.prepare.split import reversals
from rw_ekf.likelihood.model import Model
from rw_ekf.model.effect import RecordFacts

_TURN_PER_SAMPLE = 2.0  # rad: an angle is integrated where the wheel is slow enough for some of the record
_SLOW_SHARE = 0.02
_LEAST_FOR_PERIOD = 40  # samples
_REPEATS = 0.98  # of the autocorrelation at no lag


def facts_of(
    course: Course,
    model: Model,
    speed_noise_rad_s: float,
    part: BoolArray,
    channels: frozenset[str],
) -> RecordFacts:
    """Facts of the part (n,) that is searched; channels: those that are logged."""
    speed = course.speed_rad_s[part]
    speed = speed[np.isfinite(speed)]
    period = course.period_s
    top = float(np.quantile(np.abs(speed), 0.999)) if speed.size else 0.0
    slow = np.mean(np.abs(speed) * period < _TURN_PER_SAMPLE) if speed.size else 0.0
    warmth = course.temperature_degC[part]
    return RecordFacts(
        first_s=float(course.time_s[0]),
        last_s=float(course.time_s[-1]),
        period_s=period,
        top_speed_rad_s=top,
        top_current_A=float(np.max(np.abs(course.pieces.current_A))) if course.pieces.current_A.size else 0.0,
        friction=model.parameters,
        stribeck_speed_rad_s=model.stribeck.omega_s,
        stribeck_law=model.stribeck.law,
        speed_noise_rad_s=speed_noise_rad_s,
        reversals=reversals(course.speed_rad_s[part], speed_noise_rad_s),
        temperature_range_K=float(np.ptp(warmth)) if "temperature_degC" in channels else None,
        angle="angle_rad" in channels or bool(slow > _SLOW_SHARE),
        channels=channels,
        command_Hz=command_frequency(course),
    )


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
