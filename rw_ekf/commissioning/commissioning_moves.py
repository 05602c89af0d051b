"""The motions of a commissioning, as generators: a sample comes in, the current [A] to request goes out.

None of them needs to know which way a current turns the wheel, but `hold_speed` and `toggled`, which come behind that.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from rw_ekf.commissioning.guarded_wheel import Move

_RAMP_S = 18.0
_RAMP_DECADES = (
    6.0  # e-folds over the ramp: slow where a small wheel breaks away, and as slow, by share, for a large one
)
_AT_LIMIT_S = 2.0
_MOVED_READINGS = 2
_PULSE_S = 4.0
_COAST_S = 3.0
_STRONGER = 1.6
_AVERAGED_S = 0.5
_SLOW_S, _SLOW_SHARE, _BRAKED_TO = 2.0, 0.25, 3.0
_STEADY_S, _STEADY_SHARE = 3.0, 0.05


def ramp(side: float, most_A: float, moved_rad_s: float) -> Move:
    """From zero slowly up to a current, until the wheel moves."""
    sample = yield 0.0
    began_s, moved = sample.time_s, 0
    while sample.time_s - began_s < _RAMP_S + _AT_LIMIT_S:
        share = math.expm1(_RAMP_DECADES * min((sample.time_s - began_s) / _RAMP_S, 1.0)) / math.expm1(_RAMP_DECADES)
        moved = moved + 1 if abs(sample.speed_rad_s or 0.0) > moved_rad_s else 0
        if moved >= _MOVED_READINGS:
            break
        sample = yield side * most_A * share
    yield 0.0


def to_rest(rest_rad_s: float, brake_A: float = 0.0) -> Move:
    """Until the mean reading of a second is that of rest, a second long.

    brake_A: against the motion while it is fast; for a wheel whose sign is known.
    """
    sample = yield 0.0
    since_s = last_s = sample.time_s
    believed = sample.speed_rad_s or 0.0
    while sample.time_s - since_s < _SLOW_S:
        believed += min((sample.time_s - last_s) / _AVERAGED_S, 1.0) * ((sample.speed_rad_s or 0.0) - believed)
        last_s = sample.time_s
        if abs(believed) > _SLOW_SHARE * rest_rad_s:
            since_s = sample.time_s
        fast = brake_A > 0.0 and abs(believed) > _BRAKED_TO * rest_rad_s
        sample = yield -math.copysign(brake_A, believed) if fast else 0.0


def pulses(number: int, first_A: float, most_A: float, far_rad_s: float, slow_rad_s: float) -> Move:
    """Pulses both ways in turn, each from rest until the wheel is so fast, then a coast; stronger where it is not."""
    sample = yield 0.0
    current_A = min(first_A, most_A)
    for index in range(number):
        side = 1.0 if index % 2 == 0 else -1.0
        began_s = sample.time_s
        while sample.time_s - began_s < _PULSE_S and abs(sample.speed_rad_s or 0.0) < far_rad_s:
            sample = yield side * current_A
        if sample.time_s - began_s >= _PULSE_S:
            current_A = min(_STRONGER * current_A, most_A)
        began_s = sample.time_s
        while sample.time_s - began_s < _COAST_S and abs(sample.speed_rad_s or 0.0) > slow_rad_s:
            sample = yield 0.0


def hold_speed(
    target_rad_s: float, gain: float, coulomb: float, most_A: float, answered: Callable[[], bool], longest_s: float
) -> Move:
    """Turn steadily, and then until somebody has answered: friction as it was found, and what is missing beside it."""
    sample = yield 0.0
    began_s, believed = sample.time_s, sample.speed_rad_s or 0.0
    sum_rad = 0.0
    last_s = sample.time_s
    steady_s = 0.0
    while sample.time_s - began_s < longest_s and not (steady_s > _STEADY_S and answered()):
        step_s = max(sample.time_s - last_s, 0.0)
        last_s = sample.time_s
        believed += min(step_s / _AVERAGED_S, 1.0) * ((sample.speed_rad_s or 0.0) - believed)
        short = target_rad_s - believed
        if abs(short) < 0.2 * abs(target_rad_s):
            sum_rad += short * step_s
        steady_s = steady_s + step_s if abs(short) < _STEADY_SHARE * abs(target_rad_s) else 0.0
        wanted = coulomb + short + 0.2 * sum_rad
        sample = yield min(max(wanted / gain, -most_A), most_A)
    yield 0.0


def toggled(
    around_rad_s: float, change_rad_s2: float, gain: float, coulomb: float, half_s: float, lasts_s: float
) -> Move:
    """Up to a speed, then faster and slower in turn, always turning one way.

    Halves vary in length, so that no multiple of the sampling period comes again and again.
    """
    sample = yield 0.0
    began_s = sample.time_s
    while (sample.speed_rad_s or 0.0) < around_rad_s and sample.time_s - began_s < lasts_s:
        sample = yield (coulomb + change_rad_s2) / gain
    began_s = switched_s = sample.time_s
    side, count = -1.0, 0
    while sample.time_s - began_s < lasts_s:
        lasts = half_s * (0.5 if count == 0 else 1.0) * (1.0 + 0.13 * (count % 3 - 1) * (1.0 if count % 2 else -1.0))
        if sample.time_s - switched_s >= lasts:
            side, count, switched_s = -side, count + 1, sample.time_s
        drift = 0.5 * (around_rad_s - (sample.speed_rad_s or 0.0)) if sample.time_s == switched_s else 0.0
        sample = yield (coulomb + side * change_rad_s2 + drift) / gain
