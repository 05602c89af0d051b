"""Means over a piece of time of what decays or turns in it: scalar functions importing only `math`.

Most pieces are short beside a decay or a turn; a short series then says the same as the transcendental functions, to
rounding, and a search for effects evaluates them tens of millions of times.
"""

import math

_SHORT = 0.02  # of a decay
_SHORT_TURN = 0.3  # rad


def phi_1(x: float) -> float:
    """(1 - exp(-x)) / x [-], the mean of exp(-t) over 0 <= t <= x; accurate through x = 0."""
    if abs(x) < _SHORT:  # the next term: x^6/5040, below 2e-14
        square = x * x  # in pairs, which a processor works out side by side: a filter's step waits for this
        far = 1.0 / 6.0 - x * (1.0 / 24.0) + square * (1.0 / 120.0 - x * (1.0 / 720.0))
        return 1.0 - 0.5 * x + square * far
    return -math.expm1(-x) / x


def phi_1_slope(x: float) -> float:
    """d/dx of (1 - exp(-x)) / x [-], accurate through x = 0."""
    if abs(x) < _SHORT:
        square = x * x
        far = 1.0 / 8.0 - x * (1.0 / 30.0) + square * (1.0 / 144.0 - x * (1.0 / 840.0))
        return -0.5 + x * (1.0 / 3.0) - square * far
    return (math.exp(-x) * (1.0 + x) - 1.0) / (x * x)


def sinc(half: float) -> float:
    """sin(half) / half [-], the mean of a sine over a turn by 2 half [rad], to its value in the middle."""
    if abs(half) < _SHORT_TURN:  # the next term: half^10/4e7, below 2e-13
        square = half * half
        return 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)))
    return math.sin(half) / half
