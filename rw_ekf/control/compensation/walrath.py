"""Friction that follows the wheel's direction with a lag, which is learned, [L17] V.3 (7) after Walrath (1984)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rw_ekf.control.compensation.drag_reading import DragReading
from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.model.averages import phi_1
from rw_ekf.records import Tick

_LAG_S = (1e-3, 10.0)  # what is learned stays within


TUNABLE = {"time_constant_s": (0.01, 3.0)}


@dataclass(frozen=True)
class LagLearning:
    """The lag and how it is learned. Tuned: the lag that it begins with."""

    time_constant_s: float = 0.11  # tau before anything is learned
    spread: float = 1.0  # standard deviation of its logarithm then
    walk_per_sqrt_s: float = 0.03  # of its logarithm: tau "varies with the operating condition"


class LaggedFriction:
    """tau dT_f/dt + T_f = T_C sgn(omega) [L17 (7)], exactly, with its sensitivity to ln tau."""

    def __init__(self, time_constant_s: float) -> None:
        self.time_constant_s = time_constant_s
        self.friction_rad_s2 = 0.0
        self._sensitivity = 0.0  # of the friction to ln tau [rad/s^2]

    def mean(self, dt_s: float, towards_rad_s2: float) -> tuple[float, float]:
        """Mean friction over the coming interval [s], and its sensitivity to ln tau [rad/s^2]."""
        x = dt_s / self.time_constant_s
        stays = math.exp(-x)
        share = phi_1(x)
        off = self.friction_rad_s2 - towards_rad_s2
        return towards_rad_s2 + off * share, self._sensitivity * share + off * (share - stays)

    def step(self, dt_s: float, towards_rad_s2: float) -> None:
        """Follow T_C sgn(omega) [rad/s^2] over an interval [s]."""
        x = dt_s / self.time_constant_s
        stays = math.exp(-x)
        off = self.friction_rad_s2 - towards_rad_s2
        self.friction_rad_s2 = towards_rad_s2 + off * stays
        self._sensitivity = self._sensitivity * stays + off * stays * x


class Walrath:
    """I = (a + mean of T_f over the coming interval) / k, with T_C and k of the estimator.

    How tau is adapted is not stated in [L17]: here ln tau is estimated by recursive least squares from what the drag
    that was read differs from T_f, which depends on tau in a reversal only. At rest T_C acts the way requested.
    """

    def __init__(self, period_s: float, parameters: LagLearning) -> None:
        """period_s: of the loop [s]."""
        self._drag = DragReading(None, "raw")
        self._period_s = period_s
        self._lag = LaggedFriction(parameters.time_constant_s)
        self._most_variance = self._variance = parameters.spread**2
        self._walk = parameters.walk_per_sqrt_s**2
        self._towards_rad_s2 = 0.0

    @property
    def time_constant_s(self) -> float:
        """The lag [s], as learned."""
        return self._lag.time_constant_s

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2]."""
        read = self._drag.step(tick, known)
        if read is not None:
            dt_s, drag = read
            if known.speed_rad_s != 0.0:
                self._learn(dt_s, drag - known.parameters.viscous * known.speed_rad_s, tick)
            self._lag.step(dt_s, self._towards_rad_s2)
        way = known.speed_rad_s if known.speed_rad_s != 0.0 else request_rad_s2
        coulomb = known.parameters.coulomb
        self._towards_rad_s2 = 0.0 if way == 0.0 else math.copysign(coulomb, way)
        friction = self._lag.mean(self._period_s, self._towards_rad_s2)[0]
        return self._drag.wanted((request_rad_s2 + friction) / known.parameters.motor_gain)

    def _learn(self, dt_s: float, drag_rad_s2: float, tick: Tick) -> None:
        """Move ln tau by the drag [rad/s^2] of the last interval, as uncertain as the two speeds that it comes from."""
        expected = tick.estimate.innovation
        if expected is None:
            return
        mean, sensitivity = self._lag.mean(dt_s, self._towards_rad_s2)
        noise = 2.0 * (expected.std_rad_s / dt_s) ** 2
        self._variance = min(self._variance + self._walk * dt_s, self._most_variance)
        gain = self._variance * sensitivity / (noise + sensitivity * sensitivity * self._variance)
        self._variance *= 1.0 - gain * sensitivity
        moved = min(max(gain * (drag_rad_s2 - mean), -1.0), 1.0)
        low, high = _LAG_S
        self._lag.time_constant_s = min(max(self._lag.time_constant_s * math.exp(moved), low), high)
