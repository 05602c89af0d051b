"""The attitude side of the loop: a gyroscope whose rate is integrated, and the PID that asks the wheel for torque."""

from __future__ import annotations

import math
import random
from typing import NamedTuple

from rw_ekf.attitude_bench.single_axis import AxisState


class PidGains(NamedTuple):
    """Gains of the attitude controller, in torque on the body."""

    proportional_Nm_rad: float
    derivative_Nms_rad: float
    integral_Nm_rad_s: float
    settling_Nm_rad_s: float  # the integral's, before time 0


class Gyroscope:
    """A fibre-optic gyroscope: a rate with white noise, and its integral, which walks at random."""

    def __init__(self, rate_noise_rad_s: float, walk_rad_per_sqrt_s: float, seed: int) -> None:
        self._noise = rate_noise_rad_s
        self._walk = walk_rad_per_sqrt_s
        self._draw = random.Random(seed)
        self._drifted_rad = 0.0
        self._last_s: float | None = None

    def read(self, time_s: float, truth: AxisState) -> AxisState:
        """Attitude and rate as read at time_s [s]."""
        if self._last_s is not None and time_s > self._last_s:
            self._drifted_rad += self._draw.gauss(0.0, self._walk * math.sqrt(time_s - self._last_s))
        self._last_s = time_s
        return AxisState(truth.attitude_rad + self._drifted_rad, truth.rate_rad_s + self._draw.gauss(0.0, self._noise))


class AttitudePid:
    """T = -(Kp theta + Kd Omega + integral of Ki theta) on the body; the wheel is asked for -T / J_w."""

    def __init__(self, gains: PidGains, wheel_inertia_kg_m2: float) -> None:
        self._gains = gains
        self._wheel_inertia_kg_m2 = wheel_inertia_kg_m2
        self._held_Nm = 0.0  # by the integral; a change of its gain does not move it
        self._last_s: float | None = None

    def request_rad_s2(self, time_s: float, read: AxisState) -> float:
        """The wheel's acceleration [rad/s^2] that is asked for at time_s [s]."""
        if self._last_s is not None:
            gain = self._gains.settling_Nm_rad_s if time_s <= 0.0 else self._gains.integral_Nm_rad_s
            self._held_Nm += gain * read.attitude_rad * (time_s - self._last_s)
        self._last_s = time_s
        gains = self._gains
        torque_Nm = -(
            gains.proportional_Nm_rad * read.attitude_rad + gains.derivative_Nms_rad * read.rate_rad_s + self._held_Nm
        )
        return -torque_Nm / self._wheel_inertia_kg_m2
