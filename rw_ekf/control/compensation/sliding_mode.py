"""Sliding mode with a boundary layer on the wheel's speed (Utkin 1977; Slotine and Li 1991, 7.2).

The speed is to follow the integral of what is requested; friction is a disturbance of which only a bound is known:

    e = omega - omega_r,  s = e + lambda integral of e,    I = (a - lambda e - eta sat(s / phi)) / k

|s| <= phi once reached, while friction stays below eta: ds/dt = -friction - eta sat(s / phi).
"""

from __future__ import annotations

from typing import NamedTuple

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.tick_intervals import Timeline
from rw_ekf.records import Tick

TUNABLE = {"layer_rad_s": (0.05, 20.0), "slope_rad_s": (0.02, 5.0), "reach": (1.1, 5.0)}


class SlidingSurface(NamedTuple):
    """Surface, layer, and how much more than the friction of the data sheet is reached for."""

    layer_rad_s: float = 0.23  # phi
    slope_rad_s: float = 4.3  # lambda
    reach: float = 1.6  # eta over break-away friction [-]


class SlidingMode:
    """Follows the integral of the request, on the filter's speed: the sign of a reading chatters."""

    def __init__(self, motor_gain: float, static_rad_s2: float, surface: SlidingSurface) -> None:
        """motor_gain [rad/s^2/A] and break-away friction [rad/s^2] of the data sheet."""
        self._motor_gain = motor_gain
        self._eta_rad_s2 = surface.reach * static_rad_s2
        self._surface = surface
        self._timeline = Timeline()
        self._reference_rad_s: float | None = None
        self._request_rad_s2 = 0.0  # since the last tick
        self._strayed_rad = 0.0  # the integral of e
        self.s_rad_s = 0.0

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2].

        After a gap the reference is the speed that is found, and s stays as it was: it holds what friction needs.
        """
        span, (layer, slope, _) = self._timeline.step(tick), self._surface
        if span is None or self._reference_rad_s is None:
            self._reference_rad_s = known.speed_rad_s
            self._strayed_rad = self._held_within(self.s_rad_s) / slope
        else:
            self._reference_rad_s += self._request_rad_s2 * span[0]
            error = known.speed_rad_s - self._reference_rad_s
            # Outside the layer the integral would wind up: the reaching term is at its bound whatever it adds.
            strayed = self._strayed_rad + error * span[0]
            if abs(error + slope * strayed) <= layer or error * self._strayed_rad < 0.0:
                self._strayed_rad = strayed
        self._request_rad_s2 = request_rad_s2
        error = known.speed_rad_s - self._reference_rad_s
        self.s_rad_s = error + slope * self._strayed_rad
        drive = request_rad_s2 - slope * error - self._eta_rad_s2 * self._held_within(self.s_rad_s) / layer
        return self._timeline.wanted(drive / self._motor_gain)

    def _held_within(self, s_rad_s: float) -> float:
        layer = self._surface.layer_rad_s
        return max(-layer, min(layer, s_rad_s))
