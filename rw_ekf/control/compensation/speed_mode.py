"""Speed mode, [CK13] 1: a loop in the wheel's own electronics holds a speed, and friction is inside that loop.

The speed requested is the integral of the acceleration; proportional and integral action hold the speed to it:

    e = omega_r - omega,  omega_r = integral of a,    I = (a + 2 zeta w e + w^2 integral of e) / k

omega is the filter's speed, at the inner loop's rate; a hundred raw readings a second make the current chatter.
"""

from __future__ import annotations

from typing import NamedTuple

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.tick_intervals import Timeline
from rw_ekf.records import Tick

RATE_HZ = 100.0
TUNABLE = {"bandwidth_rad_s": (0.3, 30.0), "damping": (0.5, 3.0)}


class SpeedLoop(NamedTuple):
    """The inner loop's two poles, on a wheel without friction."""

    bandwidth_rad_s: float = 9.4  # w
    damping: float = 0.8  # zeta
    raw: bool = False  # hold the raw reading, not the filter's speed


class SpeedMode:
    """Holds the speed to the integral of what is requested."""

    def __init__(self, motor_gain: float, loop: SpeedLoop) -> None:
        """motor_gain: acceleration per ampere [rad/s^2/A]."""
        self._motor_gain = motor_gain
        self._proportional = 2.0 * loop.damping * loop.bandwidth_rad_s
        self._integral = loop.bandwidth_rad_s**2
        self._raw = loop.raw
        self._bandwidth_rad_s = loop.bandwidth_rad_s
        self._timeline = Timeline()
        self._reference_rad_s: float | None = None
        self._request_rad_s2 = 0.0  # since the last tick
        self._wanted_A: float | None = None
        self._held_rad_s2 = 0.0  # by the integral

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2].

        After a gap the speed that is found is the reference, and the integral stays: it holds what friction needs.
        """
        span, speed = self._timeline.step(tick), tick.sample.speed_rad_s if self._raw else known.speed_rad_s
        error = 0.0
        if span is None or self._reference_rad_s is None:
            self._reference_rad_s = speed
        else:
            dt_s, driving_A = span
            self._reference_rad_s += self._request_rad_s2 * dt_s
            if speed is not None:
                error = self._reference_rad_s - speed
                self._held_rad_s2 += self._integral * error * dt_s
            if self._wanted_A is not None:  # what the guard took away is taken back, or the integral would wind up
                refused = self._motor_gain * (driving_A - self._wanted_A)
                self._held_rad_s2 += min(1.0, self._bandwidth_rad_s * dt_s) * refused
        self._request_rad_s2 = request_rad_s2
        drive = request_rad_s2 + self._proportional * error + self._held_rad_s2
        self._wanted_A = self._timeline.wanted(drive / self._motor_gain)
        return self._wanted_A
