"""Active disturbance rejection: an extended state observer on the wheel's speed (Gao 2003; Han 2009).

Whatever the model lacks is a state z2 beside the speed z1, and is cancelled. With both poles at w (Gao's one knob):

    dz1/dt = k I - f(z1) + z2 + 2 w (omega - z1),  dz2/dt = w^2 (omega - z1),    I = (a + f(omega) - z2) / k

Bare, f is zero and z2 all of the friction; with the filter's model inside, z2 is only what that does not explain.
Sampled as by Miklosovic, Radke and Gao 2006: a prediction, then a correction with both poles at exp(-w dt).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.tick_intervals import Timeline
from rw_ekf.records import Tick

TUNABLE = {"observer_rad_s": (0.03, 30.0)}
TUNABLE_WITH_MODEL = {"observer_rad_s": (0.1, 30.0)}  # slower it would not find anything while it matters
_STEPS = 4  # of the prediction, each to second order


class BareObserver(NamedTuple):
    """The observer without a model."""

    observer_rad_s: float = 6.9  # w


class ModelObserver(NamedTuple):
    """The observer of what the filter's model leaves."""

    observer_rad_s: float = 0.1  # w


class ActiveDisturbanceRejection:
    """Cancels what the observer finds; with a model, the model's friction too."""

    def __init__(self, observer: BareObserver | ModelObserver, motor_gain: float | None = None) -> None:
        """motor_gain: of a bare observer [rad/s^2/A]; None: gain and friction are what is known at each tick."""
        self._observer_rad_s = observer.observer_rad_s
        self._motor_gain = motor_gain
        self._timeline = Timeline()
        self._speed_rad_s: float | None = None  # z1
        self.rest_rad_s2 = 0.0  # z2

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2]."""
        modelled = self._motor_gain is None
        motor_gain = known.parameters.motor_gain if self._motor_gain is None else self._motor_gain
        self._observe(tick, motor_gain, known if modelled else None)
        wanted = request_rad_s2 - self.rest_rad_s2
        drive = wanted + known.friction_against_rad_s2(wanted, known.speed_rad_s) if modelled else wanted
        return self._timeline.wanted(drive / motor_gain)

    def _observe(self, tick: Tick, motor_gain: float, model: WheelKnown | None) -> None:
        """Predict, and correct by a reading where there is one; a gap starts the speed anew and keeps the rest."""
        span, speed = self._timeline.step(tick), tick.sample.speed_rad_s
        if span is None or self._speed_rad_s is None:
            self._speed_rad_s = speed
            return
        dt_s, driving_A = span
        drive = motor_gain * driving_A + self.rest_rad_s2
        if model is None:
            predicted = self._speed_rad_s + drive * dt_s
        else:
            predicted = speed_after(self._speed_rad_s, drive, dt_s, model)
        self._speed_rad_s = predicted
        if speed is not None:
            pole = math.exp(-self._observer_rad_s * dt_s)
            self._speed_rad_s += (1.0 - pole * pole) * (speed - predicted)
            self.rest_rad_s2 += (1.0 - pole) ** 2 / dt_s * (speed - predicted)


def speed_after(speed_rad_s: float, drive_rad_s2: float, dt_s: float, model: WheelKnown) -> float:
    """The speed [rad/s] after a time under a constant drive, by a friction model, standing still included."""
    step_s = dt_s / _STEPS
    left_s = dt_s
    speed = speed_rad_s
    while left_s > 1e-12 * dt_s:
        if speed == 0.0 and abs(drive_rad_s2) <= model.parameters.static:
            return 0.0
        step = min(step_s, left_s)
        slope = drive_rad_s2 - model.friction_against_rad_s2(drive_rad_s2, speed)
        middle = speed + 0.5 * step * slope
        if middle * speed > 0.0:
            slope = drive_rad_s2 - model.friction_rad_s2(middle)
        after = speed + step * slope
        if after * speed < 0.0:  # it stops on the way, and what then happens is decided there
            step, after = -speed / slope, 0.0
        speed, left_s = after, left_s - step
    return speed
