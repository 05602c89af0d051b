"""The attitude side of the loop: the axis that is pointed, the gyroscope, and the PID that commands wheel torque.

The axis is the one-axis table or spacecraft axis of [CK13] 4 (13), exactly, by conservation of momentum.
"""

from __future__ import annotations

import math
import random
from typing import NamedTuple


class AxisState(NamedTuple):
    """Attitude and rate of the body about the wheel's axis."""

    attitude_rad: float
    rate_rad_s: float


class Axis:
    """A body of inertia J that turns about the wheel's axis, with a constant torque T_d on it.

    J dOmega/dt = T_d - J_w domega/dt [CK13 (13)] has the integral J Omega = T_d t - J_w (omega - omega_0), and its own
    integral needs no more than the wheel's angle phi: J theta = T_d t^2 / 2 - J_w (phi - phi_0 - omega_0 t). So the
    friction inside, which is the wheel's own affair, cannot turn the two together, and no step size stands in a result.
    """

    def __init__(
        self, inertia_kg_m2: float, wheel_inertia_kg_m2: float, disturbance_Nm: float, wheel_rad_s: float
    ) -> None:
        """wheel_rad_s: the wheel's speed at time 0, when the body is at rest at attitude 0."""
        self._ratio = wheel_inertia_kg_m2 / inertia_kg_m2
        self._push_rad_s2 = disturbance_Nm / inertia_kg_m2
        self._wheel_rad_s = wheel_rad_s

    def at(self, time_s: float, wheel_rad_s: float, wheel_angle_rad: float) -> AxisState:
        """Attitude and rate of the body, from the wheel's speed and the angle that it turned since time 0."""
        rate = self._push_rad_s2 * time_s - self._ratio * (wheel_rad_s - self._wheel_rad_s)
        slip_rad = wheel_angle_rad - self._wheel_rad_s * time_s
        return AxisState(0.5 * self._push_rad_s2 * time_s * time_s - self._ratio * slip_rad, rate)


class FlexibleMode:
    """A flexible appendage on the body: q'' + 2 zeta w q' + w^2 q = - gain * dOmega/dt; the attitude shows theta + q.

    Exact for an acceleration of the body that is constant over a step.
    """

    def __init__(self, frequency_hz: float, damping: float, gain: float) -> None:
        self._w = 2.0 * math.pi * frequency_hz
        self._damping = damping
        self._gain = gain
        self._rate_rad_s: float | None = None
        self.deflection_rad = 0.0
        self.deflection_rad_s = 0.0

    def step(self, rate_rad_s: float, step_s: float) -> None:
        """Follow the body over a step at whose end its rate is rate_rad_s [rad/s]."""
        before = rate_rad_s if self._rate_rad_s is None else self._rate_rad_s
        self._rate_rad_s = rate_rad_s
        if step_s <= 0.0:
            return
        w, decay = self._w, self._damping * self._w
        turning = w * math.sqrt(1.0 - self._damping * self._damping)
        rest = -self._gain * (rate_rad_s - before) / step_s / (w * w)
        start, slope = self.deflection_rad - rest, self.deflection_rad_s
        sine = (slope + decay * start) / turning
        fade, c, s = math.exp(-decay * step_s), math.cos(turning * step_s), math.sin(turning * step_s)
        self.deflection_rad = rest + fade * (start * c + sine * s)
        self.deflection_rad_s = fade * (slope * c - (decay * sine + turning * start) * s)


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
    """T = -(Kp theta + Kd Omega + integral of Ki theta) on the body; the request to the wheel is -T / J_w."""

    def __init__(self, gains: PidGains, wheel_inertia_kg_m2: float) -> None:
        self._gains = gains
        self._wheel_inertia_kg_m2 = wheel_inertia_kg_m2
        self._held_Nm = 0.0  # by the integral; a change of its gain does not move it
        self._last_s: float | None = None

    def request_rad_s2(self, time_s: float, read: AxisState) -> float:
        """The wheel's acceleration [rad/s^2] that is requested at time_s [s]."""
        if self._last_s is not None:
            gain = self._gains.settling_Nm_rad_s if time_s <= 0.0 else self._gains.integral_Nm_rad_s
            self._held_Nm += gain * read.attitude_rad * (time_s - self._last_s)
        self._last_s = time_s
        gains = self._gains
        torque_Nm = -(
            gains.proportional_Nm_rad * read.attitude_rad + gains.derivative_Nms_rad * read.rate_rad_s + self._held_Nm
        )
        return -torque_Nm / self._wheel_inertia_kg_m2
