"""Dither, [S91] claims 1 to 6: below a threshold speed an alternating torque keeps the wheel from getting stuck.

    I = (a + A (1 - |omega| / omega_t) w(t)) / k,    |omega| < omega_t,  w symmetrical about zero

It is to add no momentum, also as it is sampled: a period is an even number of cycles, whose second half is the first
one negated; the amplitude is that of the speed at its beginning; it begins and ends with whole periods only. What
unequal cycles and missed turns still add is taken back behind the period.

The frequency must lie above the highest damped natural frequency of the body with its appendages (claim 2). A loop has
half its own rate at most: 5 Hz at 10 Hz, where all three waves are one, and 2.5 Hz for one with a shape.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.scheme import Compensation
from rw_ekf.control.compensation.tick_intervals import Timeline
from rw_ekf.records import Tick
from rw_ekf.units import rad_s_from_rpm

_ROUNDING = 1e-6  # of the amplitude over a cycle: below it, clocks are equal


class DitherSignal(NamedTuple):
    """The dither as requested; a loop takes the nearest frequency that it can make.

    Not tuned by the peak of the attitude error, which does not depend on it: the threshold is the patent's, the
    amplitude what breaks the wheel free by itself, the frequency the highest at which a 10 Hz loop gives waves a shape.
    """

    threshold_rpm: float = 10.0
    amplitude: float = 1.0  # at rest, over the break-away friction of the data sheet [-]
    frequency_hz: float = 2.5


def triangular(phase: float) -> float:
    """The wave of [S91] figure 7, with its peak 1 at a quarter of its period; phase in periods."""
    return 1.0 - 4.0 * abs((phase + 0.25) % 1.0 - 0.5)


def sine(phase: float) -> float:
    """A sine wave of amplitude 1."""
    return math.sin(2.0 * math.pi * phase)


def square(phase: float) -> float:
    """A rectangular wave of amplitude 1."""
    return 1.0 if phase % 1.0 < 0.5 else -1.0


WAVES = {"triangular": triangular, "sine": sine, "square": square}


class Dither:
    """Sums a dither with another compensation's current."""

    def __init__(
        self,
        base: Compensation,
        motor_gain: float,
        static_rad_s2: float,
        rate_hz: float,
        wave: Callable[[float], float],
        signal: DitherSignal,
    ) -> None:
        """Gain [rad/s^2/A] and break-away friction [rad/s^2] of the data sheet; rate_hz: of the loop."""
        self._base = base
        self._motor_gain = motor_gain
        self._threshold_rad_s = rad_s_from_rpm(signal.threshold_rpm)
        self._most_rad_s2 = signal.amplitude * static_rad_s2
        half = max(1, round(0.5 * rate_hz / signal.frequency_hz))
        first = [wave(0.5 * (i + 0.5) / half) for i in range(half)]
        self._wave = [*first, *(-value for value in first)]
        self._cycle_s = 1.0 / rate_hz
        self._timeline = Timeline()
        self._next = 0  # place in the wave; 0: a period ends here
        self._amplitude_rad_s2 = 0.0
        self._added_rad_s = 0.0  # momentum per inertia, by what has been in force so far
        self.dither_rad_s2 = 0.0

    @property
    def frequency_hz(self) -> float:
        """The frequency that it has at the loop's rate."""
        return 1.0 / (self._cycle_s * len(self._wave))

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2]; after a gap the dither begins anew."""
        span = self._timeline.step(tick)
        if span is None:
            self._next, self._added_rad_s = 0, 0.0
        else:
            self._added_rad_s += self.dither_rad_s2 * span[0]
        base_A = self._base.current_A(tick, request_rad_s2, known)
        self.dither_rad_s2 = self._dither_rad_s2(abs(known.speed_rad_s))
        return self._timeline.wanted(base_A + self.dither_rad_s2 / self._motor_gain)

    def _dither_rad_s2(self, speed_rad_s: float) -> float:
        if self._next == 0:
            owed = -self._added_rad_s / self._cycle_s
            if abs(owed) > _ROUNDING * self._most_rad_s2:
                return max(-self._most_rad_s2, min(self._most_rad_s2, owed))
            self._added_rad_s = 0.0
            if speed_rad_s >= self._threshold_rad_s:
                return 0.0
            self._amplitude_rad_s2 = self._most_rad_s2 * (1.0 - speed_rad_s / self._threshold_rad_s)
        value = self._amplitude_rad_s2 * self._wave[self._next]
        self._next = (self._next + 1) % len(self._wave)
        return value
