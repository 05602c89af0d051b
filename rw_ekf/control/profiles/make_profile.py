"""`make_profile`: any profile by its name."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from rw_ekf.control.profiles import everyday, identification, source_profiles
from rw_ekf.errors import BadInputError

PROFILE_NAMES = ("sine", "zero", "steps", "random-sines", "identification", "P1", "P2", "S1", "S2", "S3", "S4", "S5")


@dataclass(frozen=True)
class Profile:
    """A current as a function of time: always the same for the same name, shape and seed."""

    name: str
    duration_s: float | None  # None: for ever
    law: Callable[[float], float]  # time [s] -> current [A], asked for only within the duration
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
    if name in source_profiles.SIGNALS:
        signal = source_profiles.SIGNALS[name]
        return Profile(name, signal.duration_s, signal.current_A)
    if name == "P1":
        return Profile(name, source_profiles.CK13_DURATION_S, source_profiles.random_sines_law(seed))
    if name == "P2":
        return Profile(name, source_profiles.CK13_DURATION_S, source_profiles.random_steps_law(seed))
    if name == "identification":
        return Profile(name, identification.LAW.duration_s, identification.LAW.current_A, identification.phase)
    if name == "zero":
        return Profile(name, None, lambda time_s: 0.0)
    if name == "sine":
        return Profile(name, None, everyday.sine_law(amplitude_A, period_s, bias_A))
    if name == "steps":
        return Profile(name, None, everyday.steps_law(amplitude_A, period_s, bias_A, seed))
    if name == "random-sines":
        return Profile(name, None, everyday.random_sines_law(amplitude_A, period_s, bias_A, seed))
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
