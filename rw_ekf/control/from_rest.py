"""A motion that was designed to begin at rest: the wheel is braked first, and no current drives it past a speed."""

from __future__ import annotations

import math
from typing import NamedTuple

from rw_ekf.records import Controller, RunState, Tick, WheelSample


class RestLimits(NamedTuple):
    """How a wheel is brought to rest, and what it is held below then."""

    brake_A: float
    let_go_rad_s: float  # below it friction alone stops the wheel
    still_rad_s: float  # readings within it are those of a wheel at rest
    still_s: float
    longest_s: float
    ceiling_rad_s: float  # above it a current that would accelerate becomes zero


class FromRest:
    """A commander that brakes the wheel, waits until it stands, then leaves it to the profile below a ceiling."""

    phase = "bringing the wheel to rest"

    def __init__(self, profile: Controller, limits: RestLimits) -> None:
        self._profile = profile
        self._limits = limits
        self._last: WheelSample | None = None
        self._still_s = 0.0
        self.active = True
        self.lasted_s = 0.0

    @property
    def longest_s(self) -> float:
        """How long it can last until the profile begins [s]."""
        return self._limits.longest_s

    def __call__(self, tick: Tick) -> float:
        """Return the current [A] to request after this tick's sample."""
        sample = tick.sample
        if self.active:
            held = tick.state is not None and tick.state.state is RunState.SAFE
            step_s = 0.0
            if self._last is not None and self._last.segment == sample.segment:
                step_s = max(sample.time_s - self._last.time_s, 0.0)
            self._last = sample
            self.lasted_s += step_s
            speed = sample.speed_rad_s
            if speed is not None:
                self._still_s = self._still_s + step_s if abs(speed) <= self._limits.still_rad_s else 0.0
            at_rest = self._still_s >= self._limits.still_s or self.lasted_s >= self._limits.longest_s
            if held or not at_rest:
                brakes = speed is not None and abs(speed) > self._limits.let_go_rad_s and not held
                return -math.copysign(self._limits.brake_A, speed) if brakes and speed is not None else 0.0
            self.active = False
        current = self._profile(tick)
        speed = sample.speed_rad_s
        outward = speed is not None and abs(speed) > self._limits.ceiling_rad_s and current * speed > 0.0
        return 0.0 if outward else current
