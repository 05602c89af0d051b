"""A wheel for compensations, stepped by Euler in milliseconds, which shares nothing with the estimator or the plant."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.scheme import Compensation
from rw_ekf.model.friction import GAUSS, Stribeck
from rw_ekf.model.state import FrictionParameters
from rw_ekf.records import Tick, WheelSample
from tests.ticks import tick_of

GAIN, COULOMB = 15.0, 0.6
STRIBECK = Stribeck(0.42, GAUSS)
BELIEVED = FrictionParameters(GAIN, 0.0, COULOMB, COULOMB)
_FINE_S = 1e-3

Friction = Callable[[float, float], float]  # time, speed: what slows the wheel; at rest, the most that can hold it


def coulomb(level: float = COULOMB, viscous: float = 0.0) -> Friction:
    """Dry friction without a bump, and a viscous part."""
    return lambda time_s, speed: level + viscous * abs(speed)


@dataclass
class BareWheel:
    """d omega/dt = k I - sgn(omega) f(t, omega) + disturbance(t), held at rest by up to f; read every period."""

    friction: Friction
    speed: float = 0.0
    disturbance: Callable[[float], float] = lambda time_s: 0.0
    period_s: float = 0.1
    believed: FrictionParameters = BELIEVED
    noise: Callable[[], float] = lambda: 0.0
    time_s: float = 0.0
    current_A: float = 0.0
    speeds: list[float] = field(default_factory=list)
    currents: list[float] = field(default_factory=list)

    def tick(self) -> Tick:
        """What the loop would hand over now."""
        return tick_of(WheelSample(self.time_s, self.speed + self.noise(), current_command_A=self.current_A))

    def known(self) -> WheelKnown:
        """The true speed, and what is believed of the wheel."""
        return WheelKnown.of_parameters(self.speed, self.believed, STRIBECK)

    def run(self, scheme: Compensation, request: Callable[[float], float], lasts_s: float) -> None:
        """Let a scheme drive it."""
        end = self.time_s + lasts_s - 0.5 * self.period_s
        while self.time_s < end:
            self.current_A = scheme.current_A(self.tick(), request(self.time_s), self.known())
            self.currents.append(self.current_A)
            self.advance(self.period_s)
            self.speeds.append(self.speed)

    def advance(self, lasts_s: float) -> None:
        """Let time pass under the present current."""
        steps = max(1, round(lasts_s / _FINE_S))
        step = lasts_s / steps
        for _ in range(steps):
            drive = GAIN * self.current_A + self.disturbance(self.time_s)
            slows = self.friction(self.time_s, self.speed)
            if self.speed == 0.0:
                self.speed = 0.0 if abs(drive) <= slows else step * (drive - math.copysign(slows, drive))
            else:
                after = self.speed + step * (drive - math.copysign(slows, self.speed))
                self.speed = after if after * self.speed > 0.0 else 0.0
            self.time_s += step
