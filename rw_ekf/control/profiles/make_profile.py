"""`make_profile`: any profile by its name.

Beside the shaped ones those of the sources: P1 and P2 of [CK13] (described there, not tabulated), S1 to S5 of [F12],
Table 1, and `identification`.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass

from rw_ekf.control.profiles import identification
from rw_ekf.control.profiles.profile_pieces import DrawnCycles, PiecewiseLinear, hold
from rw_ekf.errors import BadInputError

PROFILE_NAMES = ("sine", "zero", "steps", "random-sines", "identification", "P1", "P2", "S1", "S2", "S3", "S4", "S5")
_LEAST_SHARE = 0.5  # of the amplitude: below it friction would hold many a wheel
_CK13_DURATION_S = 300.0
# [CK13] says "small amplitude", "low speeds", 24 crossings of zero in P1 and 9 in P2, but gives no ranges. These were
# chosen so that the crossings come out, and what one run of P2 can show of the parameters (its Cramer-Rao bound at
# 1 rpm and 10 Hz) is about 0.0026, 2e-5, 4.7e-4, 0.006.
_P1_AMPLITUDE_A = (0.08, 0.16)
_P1_PERIOD_S = (20.0, 30.0)
_P2_AMPLITUDE_A = (0.06, 0.15)
_P2_STEP_S = 30.0
_SIGNALS = {  # amplitude [A], period [s], duration [s]; all about the same bias
    "S1": (0.1, 480.0, 1440.0),
    "S2": (0.1, 120.0, 360.0),
    "S3": (0.1, 30.0, 90.0),
    "S4": (0.2, 120.0, 360.0),
    "S5": (0.2, 30.0, 90.0),
}
_SIGNAL_BIAS_A = -0.05


@dataclass(frozen=True)
class Profile:
    """A current as a function of time: always the same for the same name, shape and seed."""

    name: str
    duration_s: float | None  # None: for ever
    law: Callable[[float], float]  # time [s] -> current [A], evaluated only within the duration
    phase: Callable[[float], str] | None = None  # what it is at, by its time [s]; None: the same thing throughout

    def current_A(self, time_s: float) -> float:
        """Current [A] at `time_s` from the start of the profile [s]; zero before it and from its end on."""
        if time_s < 0.0 or (self.duration_s is not None and time_s >= self.duration_s):
            return 0.0
        return self.law(time_s)


def make_profile(
    name: str, *, amplitude_A: float = 0.1, period_s: float = 30.0, bias_A: float = 0.0, seed: int = 1
) -> Profile:
    """Make the profile called `name`.

    amplitude_A, period_s, bias_A shape sine, steps and random-sines; the published profiles and `identification` are
    what they are. seed: of steps, random-sines, P1 and P2.
    Raises BadInputError if there is no such profile.
    """
    if name in _SIGNALS:
        signal_A, signal_s, lasts_s = _SIGNALS[name]
        return Profile(name, lasts_s, _signal_law(signal_A, signal_s))
    if name == "P1":
        return Profile(name, _CK13_DURATION_S, _ck13_sines_law(seed))
    if name == "P2":
        return Profile(name, _CK13_DURATION_S, _ck13_steps_law(seed))
    if name == "identification":
        return Profile(name, identification.LAW.duration_s, identification.LAW.current_A, identification.phase)
    if name == "zero":
        return Profile(name, None, lambda time_s: 0.0)
    if name == "sine":
        return Profile(name, None, _sine_law(amplitude_A, period_s, bias_A))
    if name == "steps":
        return Profile(name, None, _steps_law(amplitude_A, period_s, bias_A, seed))
    if name == "random-sines":
        return Profile(name, None, _random_sines_law(amplitude_A, period_s, bias_A, seed))
    raise BadInputError(f"there is no profile {name!r}; profiles: {', '.join(PROFILE_NAMES)}")


def sample_profile(
    profile: Profile, rate_hz: float, duration_s: float | None = None
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Sample a profile: times k / rate_hz [s] from 0 up to its end, and the current at each [A].

    duration_s: for a profile without an end, or to cut one short. Raises ValueError if neither gives an end.
    """
    ends_s = [end for end in (profile.duration_s, duration_s) if end is not None]
    if not ends_s:
        raise ValueError(f"profile {profile.name} has no end: give duration_s")
    # A hair less, or rounding in the product would add a row at the very end.
    count = math.ceil(min(ends_s) * rate_hz * (1.0 - 1e-12))
    time_s = tuple(index / rate_hz for index in range(count))
    return time_s, tuple(profile.current_A(moment) for moment in time_s)


def _sine_law(amplitude_A: float, period_s: float, bias_A: float) -> Callable[[float], float]:
    """Give bias + amplitude * sin(2 pi t / period)."""
    return lambda time_s: bias_A + amplitude_A * math.sin(2.0 * math.pi * time_s / period_s)


def _steps_law(amplitude_A: float, period_s: float, bias_A: float, seed: int) -> Callable[[float], float]:
    """Constant currents that change sign every half period; each is 50 to 100 % of the amplitude."""
    draws = random.Random(seed)
    cycles = DrawnCycles(lambda: (0.5 * period_s, amplitude_A * draws.uniform(_LEAST_SHARE, 1.0)))

    def law(time_s: float) -> float:
        _, level_A, number = cycles.at(time_s)
        return bias_A + (level_A if number % 2 == 0 else -level_A)

    return law


def _random_sines_law(amplitude_A: float, period_s: float, bias_A: float, seed: int) -> Callable[[float], float]:
    """Full sines one after another: each of 50 to 100 % of the amplitude and 50 to 150 % of the period."""
    draws = random.Random(seed)
    cycles = DrawnCycles(lambda: (period_s * draws.uniform(0.5, 1.5), amplitude_A * draws.uniform(_LEAST_SHARE, 1.0)))
    return lambda time_s: bias_A + cycles.sine_A(time_s)


def _signal_law(amplitude_A: float, period_s: float) -> Callable[[float], float]:
    """S1 to S5: a sine about their bias."""
    return lambda time_s: amplitude_A * math.sin(2.0 * math.pi / period_s * time_s) + _SIGNAL_BIAS_A


def _ck13_sines_law(seed: int) -> Callable[[float], float]:
    """P1: full sines one after another, each of random amplitude and period."""
    draws = random.Random(seed)
    return DrawnCycles(lambda: (draws.uniform(*_P1_PERIOD_S), draws.uniform(*_P1_AMPLITUDE_A))).sine_A


def _ck13_steps_law(seed: int) -> Callable[[float], float]:
    """P2: constant currents of random amplitude that reverse every 30 s."""
    draws = random.Random(seed)
    steps = round(_CK13_DURATION_S / _P2_STEP_S)
    levels_A = [draws.uniform(*_P2_AMPLITUDE_A) * (1 if index % 2 == 0 else -1) for index in range(steps)]
    return PiecewiseLinear([hold(_P2_STEP_S, level_A) for level_A in levels_A]).current_A
