"""Friction whose jump at rest is shaped by a parabola, [L17] V.5 after Lee, Kim and Lee (2013)."""

from __future__ import annotations

import math
from typing import NamedTuple

from rw_ekf.control.compensation.known import Friction, WheelKnown
from rw_ekf.records import Tick

_SLOPE_OVER = 1e-4  # of the width

TUNABLE = {"width_rad_s": (0.05, 10.0)}


class Parabola(NamedTuple):
    """a0 + a1 v + a2 v^2 at a speed v >= 0 in the direction of motion [rad/s^2]."""

    a0: float  # rad/s^2
    a1: float  # 1/s
    a2: float  # 1/rad

    def __call__(self, v: float) -> float:
        """Its value [rad/s^2] at v [rad/s]."""
        return self.a0 + v * (self.a1 + v * self.a2)

    @classmethod
    def shaping(cls, width_rad_s: float, friction: float, slope_1_s: float) -> Parabola:
        """The one that vanishes at rest and at `width` has a friction [rad/s^2] and its slope there."""
        return cls(
            0.0,
            2.0 * friction / width_rad_s - slope_1_s,
            (slope_1_s - friction / width_rad_s) / width_rad_s,
        )


class CommandShaping:
    """I = (a + f_s(omega)) / k: f_s is the model's friction, and below `width` the parabola that meets it smoothly.

    With the sign of the speed the three conditions make f_s continuous everywhere, smooth but at rest, and blind there:
    at rest it adds nothing.
    """

    def __init__(self, width_rad_s: float = 0.05) -> None:
        """width_rad_s: the speed below which friction is shaped, tuned. Raises ValueError where it is not above 0."""
        if not width_rad_s > 0.0:
            raise ValueError(f"width_rad_s {width_rad_s} must be above 0")
        self._width = width_rad_s

    def shaped(self, speed_rad_s: float, friction: Friction) -> float:
        """f_s [rad/s^2] at a speed, of a friction that is signed as the speed is."""
        v, width = abs(speed_rad_s), self._width
        if v >= width:
            return friction(speed_rad_s)
        way, step = math.copysign(1.0, speed_rad_s), _SLOPE_OVER * width
        above, below = (way * friction(way * (width + d)) for d in (step, -step))
        parabola = Parabola.shaping(width, way * friction(way * width), (above - below) / (2.0 * step))
        return way * parabola(v)

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2]."""
        return (request_rad_s2 + self.shaped(known.speed_rad_s, known.friction_rad_s2)) / known.parameters.motor_gain
