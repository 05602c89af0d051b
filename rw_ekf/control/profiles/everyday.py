"""The shaped profiles: sine, steps and random-sines."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

from rw_ekf.control.profiles.profile_pieces import DrawnCycles

_LEAST_SHARE = 0.5  # of the amplitude: below it friction would hold many a wheel


def sine_law(amplitude_A: float, period_s: float, bias_A: float) -> Callable[[float], float]:
    """Give bias + amplitude * sin(2 pi t / period)."""
    return lambda time_s: bias_A + amplitude_A * math.sin(2.0 * math.pi * time_s / period_s)


def steps_law(amplitude_A: float, period_s: float, bias_A: float, seed: int) -> Callable[[float], float]:
    """Constant currents that change sign every half period; each is 50 to 100 % of the amplitude."""
    draws = random.Random(seed)
    cycles = DrawnCycles(lambda: (0.5 * period_s, amplitude_A * draws.uniform(_LEAST_SHARE, 1.0)))

    def law(time_s: float) -> float:
        _, level_A, number = cycles.at(time_s)
        return bias_A + (level_A if number % 2 == 0 else -level_A)

    return law


def random_sines_law(amplitude_A: float, period_s: float, bias_A: float, seed: int) -> Callable[[float], float]:
    """Full sines one after another: each of 50 to 100 % of the amplitude and 50 to 150 % of the period."""
    draws = random.Random(seed)
    cycles = DrawnCycles(lambda: (period_s * draws.uniform(0.5, 1.5), amplitude_A * draws.uniform(_LEAST_SHARE, 1.0)))
    return lambda time_s: bias_A + cycles.sine_A(time_s)
