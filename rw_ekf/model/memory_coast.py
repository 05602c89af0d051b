"""A wheel far from zero speed whose dry friction has a memory: its flow in closed form, without steps.

Beyond `plain_beyond` the static friction is c. What the friction differs from it by fades, with a lag in time and with
a bristle in the angle, and takes a known momentum from the wheel meanwhile. Scalar functions that import only `math`.
"""

from __future__ import annotations

import math

from rw_ekf.model.averages import phi_1
from rw_ekf.model.friction import GAUSS, TUSTIN, far_limit

LAG = 0
BRISTLE = 1

# b [1/s], c, s [rad/s^2], omega_s [rad/s], Stribeck law, LAG or BRISTLE, 1/tau [1/s] or sigma0 [1/s^2], kappa [s]
Wheel = tuple[float, float, float, float, int, int, float, float]

TOLERANCE = 1.0e-6  # error of one step, in Stribeck speeds; smaller than what the filter's differences could see
_UNSEEN = 0.1  # of that error: what may be left out
_GENTLE, _STEADY = 0.1, 0.3  # shares of change up to which a series is worth looking at
_SETTLED = 1.0e-9  # relative distance of the memory from its static value that no longer counts


def plain_beyond(c: float, s: float, omega_s: float, law: int, duration: float) -> float:
    """Speed [rad/s] from which on the Stribeck term moves the wheel by less than a step's error in `duration`."""
    share = _UNSEEN * TOLERANCE * omega_s / max(abs(s - c) * duration, 1.0e-300)
    logarithm = -math.log(min(share, 1.0))
    u = far_limit(law)
    if law == GAUSS:
        u = min(u, math.sqrt(logarithm))
    elif law == TUSTIN:
        u = min(u, logarithm)
    return max(u, 1.0) * omega_s


def coast(v: float, f: float, push: float, far: float, h: float, wheel: Wheel) -> tuple[bool, float, float]:
    """(whether the wheel stays beyond `far` for h seconds with a memory that has a closed form, v and f then).

    The excess f - c of a lag fades exponentially with time, that of a bristle with the angle.
    """
    b, c, _, _, _, kind, rate, _ = wheel
    excess = f - c
    end = v + (push - c - b * v) * h * phi_1(b * h)
    if kind == BRISTLE:
        if end >= far and abs(excess) > _SETTLED * abs(c):
            return _slide(v, excess, push, far, h, end, wheel)
        return end >= far, end, c
    f_end = c + excess * math.exp(-rate * h)
    end -= excess * math.exp(-min(b, rate) * h) * h * phi_1(abs(rate - b) * h)
    dips = push - b * v - f < 0.0 < push - b * end - f_end
    return end >= far and not dips, end, f_end


def _slide(
    v: float, excess: float, push: float, far: float, h: float, free: float, wheel: Wheel
) -> tuple[bool, float, float]:
    """(whether this is exact enough, v and f after h seconds) of a fast wheel whose bristle is not bent as it will be.

    docs/effects.md eq. 8a. free: the speed after h seconds without the excess of the friction.
    """
    b, c, _, omega_s, _, _, rate, kappa = wheel
    fades = c / (rate * v)  # time constant of the excess [s]
    slope = push - c - b * v
    gains = slope * fades / v  # share by which the speed changes while the excess fades
    jolt = excess * (kappa - fades) / v  # the same by the excess itself
    if not (abs(gains) < _GENTLE and abs(jolt) < _GENTLE and abs(b) * fades < _GENTLE and abs(b) * h < _STEADY):
        return False, v, c + excess
    moved = jolt * (h + fades * math.expm1(-h / fades))
    turned = 0.5 * (v + free) / v * h - slope / v * b * (h * h * h) / 12.0 + moved  # in units of v [s]
    angle = turned / fades
    left = math.exp(-angle)
    gone = 1.0 - left
    first = gone - angle * left
    second = 2.0 * first - angle * angle * left
    impulse = gone - (gains - b * fades) * first + 1.5 * gains * gains * second - 0.5 * jolt * gone * gone
    impulse *= excess * fades
    faded = math.exp(-b * h)
    end = free - faded * (1.0 - kappa * b) * impulse - kappa * excess * (left - faded)
    gains, jolt, braked = abs(gains), abs(jolt), abs(b) * fades
    omitted = fades * (jolt * jolt + jolt * gains + 15.0 * (gains * gains * gains) + braked * (braked + gains + jolt))
    omitted += (kappa + fades) * left * abs(moved) / fades * (gains + jolt + abs(b) * h)
    exact = abs(excess) * omitted < TOLERANCE * max(omega_s, 0.01 * v)
    return exact and min(v, free) - abs(excess) * (kappa + fades) >= far, end, c + excess * left
