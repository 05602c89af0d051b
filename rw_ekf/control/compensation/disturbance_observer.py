"""Disturbance observer on the wheel's speed (Ohnishi, Shibata and Murakami 1996; Chen, Yang, Guo and Li 2016).

What drives the wheel less what it did is friction, all of it, whatever its law; a filter Q takes the noise off:

    f = Q(s) (k I - s omega),  Q(s) = g / (s + g),    I = (a + f) / k

Between two readings k I - (omega_2 - omega_1) / dt is the friction's mean, exactly; Q is discretised for it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.timeline import Timeline
from rw_ekf.records import Tick

TUNABLE = {"cutoff_rad_s": (0.03, 30.0)}


class ObserverFilter(NamedTuple):
    """The filter Q, of first order."""

    cutoff_rad_s: float = 1.0  # g


class DisturbanceObserver:
    """I = (a + f) / k with the friction that the last readings show. It sees readings only, and no model."""

    def __init__(self, motor_gain: float, q: ObserverFilter) -> None:
        """motor_gain: acceleration per ampere [rad/s^2/A]."""
        self._motor_gain = motor_gain
        self._cutoff_rad_s = q.cutoff_rad_s
        self._timeline = Timeline()
        self._speed_rad_s: float | None = None  # the last reading
        self._since_s = 0.0  # then
        self._driven_rad_s = 0.0  # the integral of k I over that time
        self.friction_rad_s2 = 0.0

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2]; without a reading the friction of before holds."""
        span, speed = self._timeline.step(tick), tick.sample.speed_rad_s
        if span is None:
            self._speed_rad_s = None
        else:
            dt_s, driving_A = span
            self._since_s += dt_s
            self._driven_rad_s += self._motor_gain * driving_A * dt_s
        if speed is not None:
            if self._speed_rad_s is not None and self._since_s > 0.0:
                mean = (self._driven_rad_s - (speed - self._speed_rad_s)) / self._since_s
                share = -math.expm1(-self._cutoff_rad_s * self._since_s)
                self.friction_rad_s2 += share * (mean - self.friction_rad_s2)
            self._speed_rad_s, self._since_s, self._driven_rad_s = speed, 0.0, 0.0
        return self._timeline.asked((request_rad_s2 + self.friction_rad_s2) / self._motor_gain)
