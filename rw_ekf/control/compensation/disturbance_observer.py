"""Disturbance observer on the wheel's speed (Ohnishi, Shibata and Murakami 1996; Chen, Yang, Guo and Li 2016).

What drives the wheel less what it did is friction, all of it, whatever its law; a filter Q takes the noise off:

    f = Q(s) (k I - s omega),  Q(s) = g / (s + g),    I = (a + f) / k

Between two readings k I - (omega_2 - omega_1) / dt is the friction's mean, exactly; Q is discretised for it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rw_ekf.control.compensation.drag_reading import DragReading
from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.records import Tick

TUNABLE = {"cutoff_rad_s": (0.03, 30.0)}


class ObserverFilter(NamedTuple):
    """The filter Q, of first order."""

    cutoff_rad_s: float = 3.4  # g


class DisturbanceObserver:
    """I = (a + f) / k with the friction that the last readings show. It sees readings only, and no model."""

    def __init__(self, motor_gain: float, q: ObserverFilter) -> None:
        """motor_gain: acceleration per ampere [rad/s^2/A]."""
        self._motor_gain = motor_gain
        self._cutoff_rad_s = q.cutoff_rad_s
        self._drag = DragReading(motor_gain, "raw")
        self.friction_rad_s2 = 0.0

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2]; without a reading the friction of before holds."""
        read = self._drag.step(tick, known)
        if read is not None:
            lasted_s, mean = read
            self.friction_rad_s2 -= math.expm1(-self._cutoff_rad_s * lasted_s) * (mean - self.friction_rad_s2)
        return self._drag.wanted((request_rad_s2 + self.friction_rad_s2) / self._motor_gain)
