"""The profiles of the sources: P1 and P2 of [CK13] (described there, not tabulated), S1 to S5 of [F12], Table 1."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass

from rw_ekf.control.profiles.profile_pieces import DrawnCycles, PiecewiseLinear, hold

CK13_DURATION_S = 300.0
# [CK13] says "small amplitude", "low speeds", 24 crossings of zero in P1 and 9 in P2, but gives no ranges. These were
# chosen so that the crossings come out, and what one run of P2 can tell about the parameters (its Cramer-Rao bound at
# 1 rpm and 10 Hz) is about 0.0026, 2e-5, 4.7e-4, 0.006.
_P1_AMPLITUDE_A = (0.08, 0.16)
_P1_PERIOD_S = (20.0, 30.0)
_P2_AMPLITUDE_A = (0.06, 0.15)
_P2_STEP_S = 30.0


@dataclass(frozen=True)
class BiasedSine:
    """amplitude * sin(2 pi t / period) + bias, for `duration_s`."""

    amplitude_A: float
    period_s: float
    bias_A: float
    duration_s: float

    def current_A(self, time_s: float) -> float:
        """Current at a time from the start [A]."""
        return self.amplitude_A * math.sin(2.0 * math.pi / self.period_s * time_s) + self.bias_A


SIGNALS = {
    "S1": BiasedSine(0.1, 480.0, -0.05, 1440.0),
    "S2": BiasedSine(0.1, 120.0, -0.05, 360.0),
    "S3": BiasedSine(0.1, 30.0, -0.05, 90.0),
    "S4": BiasedSine(0.2, 120.0, -0.05, 360.0),
    "S5": BiasedSine(0.2, 30.0, -0.05, 90.0),
}


def random_sines_law(seed: int) -> Callable[[float], float]:
    """P1: full sines one after another, each of random amplitude and period."""
    draws = random.Random(seed)
    return DrawnCycles(lambda: (draws.uniform(*_P1_PERIOD_S), draws.uniform(*_P1_AMPLITUDE_A))).sine_A


def random_steps_law(seed: int) -> Callable[[float], float]:
    """P2: constant currents of random amplitude that reverse every 30 s."""
    draws = random.Random(seed)
    steps = round(CK13_DURATION_S / _P2_STEP_S)
    levels_A = [draws.uniform(*_P2_AMPLITUDE_A) * (1 if index % 2 == 0 else -1) for index in range(steps)]
    return PiecewiseLinear([hold(_P2_STEP_S, level_A) for level_A in levels_A]).current_A
