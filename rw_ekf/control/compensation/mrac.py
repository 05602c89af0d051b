"""Model reference adaptive control, [L17] V.2 after Gilbart and Winston (1974): a model leads, friction is learned."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from rw_ekf.control.compensation.drag_reading import Readings, SpeedSource
from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.tick_intervals import Timeline
from rw_ekf.model.state import FrictionParameters
from rw_ekf.records import Outcome, Tick

_LARGEST_RAD_S = 1.0e6  # of an error: no wheel; keeps what is learned finite


TUNABLE = {"bandwidth_rad_s": (0.05, 6.0)}
ON_READINGS_RAD_S, WITH_FILTERED_SIGN_RAD_S = 0.085, 0.093  # bandwidths that were tuned for them


@dataclass(frozen=True)
class MracParameters:
    """Gains of the adaptation by its two poles: lambda = 2 damping bandwidth, gamma = bandwidth^2. Tuned: the first."""

    bandwidth_rad_s: float = 2.8
    damping: float = 0.707
    limit_of_static: float = 6.0  # of what is learned, as a multiple of the data sheet's break-away friction
    speed: SpeedSource = "filtered"  # that the model is compared with
    sign: SpeedSource = "filtered"  # of the speed

    @property
    def proportional_1_s(self) -> float:
        """Friction at once, per error of speed: lambda."""
        return 2.0 * self.damping * self.bandwidth_rad_s

    @property
    def integral_1_s2(self) -> float:
        """Friction learned, per error of speed and second: gamma."""
        return self.bandwidth_rad_s**2


class Mrac:
    """The ideal wheel of the data sheet leads, by e = omega_m - omega; a Lyapunov function says how to learn from it.

    Model:      d omega_m/dt = a + b (omega - omega_m), first order, with the sheet's viscous friction b
    Current:    k I = a + b omega + C sgn(omega) + lambda e
    Adaptation: dC/dt = gamma e sgn(omega)

    For a wheel with friction b omega + c sgn(omega), de/dt = -(b + lambda) e + (c - C) sgn(omega), and
    V = e^2/2 + (c - C)^2/(2 gamma) falls as dV/dt = -(b + lambda) e^2: C is learned once, for both directions, and
    changes its sign with the wheel. A wheel at rest is taken to move in the requested direction. On the filter's speed
    it is deaf to a drag that the filter's model knows not of, on the sign of readings it chatters: the model compared
    with readings and the filter's sign have neither.
    """

    def __init__(self, sheet: FrictionParameters, parameters: MracParameters) -> None:
        """sheet: nominal motor gain and viscous friction; Coulomb friction is learned from 0."""
        self._gain = sheet.motor_gain
        self._viscous = sheet.viscous
        self._proportional = parameters.proportional_1_s
        self._integral = parameters.integral_1_s2
        self._limit_rad_s2 = parameters.limit_of_static * sheet.static
        self._readings = Readings() if parameters.speed == "raw" else None
        self._raw_sign = parameters.sign == "raw"
        self._timeline = Timeline()
        self._model_rad_s: float | None = None
        self._wanted_rad_s2 = 0.0  # of the model, over the interval that the next sample ends
        self._pushed_rad_s2 = 0.0  # of the motor then
        self.error_rad_s = 0.0  # e: by how much the model leads
        self._sign = 0.0
        self.coulomb_rad_s2 = 0.0  # as learned

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2]."""
        step = self._timeline.step(tick)
        speed = known.speed_rad_s if self._readings is None else self._readings.usable(tick)
        seeded = self._readings is None and tick.estimate.outcome is Outcome.RESEEDED
        if step is None or seeded or self._model_rad_s is None:
            self._model_rad_s = None if speed is None else speed + self.error_rad_s  # after a gap the lead is kept
        else:
            self._follow(*step, speed)
        way = speed if self._raw_sign else known.speed_rad_s
        if way is not None:
            self._sign = math.copysign(1.0, way) if way != 0.0 else _sign(request_rad_s2)
        viscous = self._viscous * (known.speed_rad_s if speed is None else speed)
        friction = viscous + self.coulomb_rad_s2 * self._sign + self._proportional * self.error_rad_s
        self._wanted_rad_s2 = request_rad_s2
        self._pushed_rad_s2 = request_rad_s2 + friction
        return self._timeline.wanted(self._pushed_rad_s2 / self._gain)

    def _follow(self, dt_s: float, current_A: float, speed_rad_s: float | None) -> None:
        """Move the model on, and learn. What the guard took from the current is taken from the model's drive too."""
        assert self._model_rad_s is not None
        drive = self._wanted_rad_s2 + self._gain * current_A - self._pushed_rad_s2
        keeps = math.exp(-self._viscous * dt_s)
        along = dt_s if self._viscous == 0.0 else (1.0 - keeps) / self._viscous
        towards = self._model_rad_s if speed_rad_s is None else speed_rad_s
        self._model_rad_s = towards + (self._model_rad_s - towards) * keeps + along * drive
        if speed_rad_s is None:
            return
        error = min(max(self._model_rad_s - speed_rad_s, -_LARGEST_RAD_S), _LARGEST_RAD_S)
        mean = 0.5 * (self.error_rad_s + error)
        learned = self.coulomb_rad_s2 + self._integral * mean * self._sign * dt_s
        self.coulomb_rad_s2 = min(max(learned, 0.0), self._limit_rad_s2)
        self.error_rad_s = error
        self._model_rad_s = speed_rad_s + error


def _sign(value: float) -> Literal[-1, 0, 1]:
    return 1 if value > 0.0 else -1 if value < 0.0 else 0
