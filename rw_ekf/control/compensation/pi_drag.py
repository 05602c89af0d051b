"""Cassini's estimator of the bearing's drag with its limiter, [L17] II, Fig. 2, (1); and how far off it may be, (6)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rw_ekf.control.compensation.drag_reading import DragReading, SpeedSource
from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.model.state import FrictionParameters
from rw_ekf.records import Tick

CASSINI_RAD_S = 2.0 * math.pi * 0.01
CASSINI_DAMPING = 0.707


TUNABLE = {
    "bandwidth_rad_s": (0.05, 5.0)
}  # beyond, the bench's loop has less than 45 degrees: tests/bench/drag_margins.py


@dataclass(frozen=True)
class PiDragParameters:
    """Of the estimator and the limiter. Tuned: the bandwidth; Cassini's is `CASSINI_RAD_S`."""

    bandwidth_rad_s: float = 1.8
    damping: float = CASSINI_DAMPING
    limit_of_static: float = 6.0  # the limiter, as a multiple of the data sheet's break-away friction
    speed: SpeedSource = "raw"  # the filtered one is led by the filter's own friction model: no observer then


class PiDragEstimator:
    """T_est / T_phy = (2 xi w s + w^2) / (s^2 + 2 xi w s + w^2) [L17 (1)], at any interval.

    Fig. 2 holds a proportional and an integral gain on the error e of the wheel's rate: de/dt = T_phy - T_est with
    T_est = 2 xi w e + w^2 z, dz/dt = e. Exact for a drag that is constant over the interval.
    """

    def __init__(self, bandwidth_rad_s: float = CASSINI_RAD_S, damping: float = CASSINI_DAMPING) -> None:
        """Raises ValueError for a bandwidth that is not above 0 or a damping that is not between 0 and 1."""
        if not (bandwidth_rad_s > 0.0 and 0.0 < damping < 1.0):
            raise ValueError(f"bandwidth {bandwidth_rad_s} must be above 0, damping {damping} between 0 and 1")
        self._w = bandwidth_rad_s
        self._damping = damping
        self._error = 0.0  # e
        self._held = 0.0  # w^2 z: the integrator's path

    @property
    def estimate(self) -> float:
        """T_est, in the unit of the drag."""
        return 2.0 * self._damping * self._w * self._error + self._held

    @property
    def integrator_path(self) -> float:
        """What the integrator alone contributes, in the unit of the drag."""
        return self._held

    def step(self, dt_s: float, drag: float) -> float:
        """T_est after an interval [s] of a drag in any unit; returns it in the same."""
        w, decay = self._w, self._damping * self._w
        turning = w * math.sqrt(1.0 - self._damping * self._damping)
        fade, c, s = math.exp(-decay * dt_s), math.cos(turning * dt_s), math.sin(turning * dt_s)
        off, slope = (self._held - drag) / (w * w), self._error  # of z from its rest, and its rate
        self._held = drag + w * w * fade * (off * c + (slope + decay * off) / turning * s)
        self._error = fade * (slope * c - (decay * slope + w * w * off) / turning * s)
        return self.estimate


class PiDrag:
    """I = (a + limited T_est) / k, with the motor gain of the data sheet.

    The drag is what the current that was in force did not turn into speed, so that neither the limiter nor the guard
    winds the estimator up, as they would where the rate error were counted from the request.
    """

    def __init__(self, sheet: FrictionParameters, parameters: PiDragParameters) -> None:
        self._gain = sheet.motor_gain
        self._drag = DragReading(sheet.motor_gain, parameters.speed)
        self._estimator = PiDragEstimator(parameters.bandwidth_rad_s, parameters.damping)
        self._limit_rad_s2 = parameters.limit_of_static * sheet.static

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2]."""
        read = self._drag.step(tick, known)
        if read is not None:
            self._estimator.step(*read)
        estimate = min(max(self._estimator.estimate, -self._limit_rad_s2), self._limit_rad_s2)
        return self._drag.wanted((request_rad_s2 + estimate) / self._gain)
