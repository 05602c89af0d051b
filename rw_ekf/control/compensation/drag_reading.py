"""The drag that a wheel showed since the reading before: the push of its motor less what it gained in speed."""

from __future__ import annotations

from typing import Literal

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.timeline import Timeline
from rw_ekf.records import Outcome, Tick

SpeedSource = Literal["filtered", "raw"]  # the filter's speed, or the reading itself

_UNUSABLE = (Outcome.GATED, Outcome.REPEATED, Outcome.BACKWARD)
_LARGEST_RAD_S2 = 1.0e6  # no wheel; keeps the sums of an observer finite


class DragReading:
    """Mean of k I - domega/dt between two usable speeds, whatever was missing between them [rad/s^2].

    Where the motor gain k is a data sheet's, its error is part of the drag, and compensated with it. A gap in time, a
    new segment and a speed that the filter seeded afresh begin anew.
    """

    def __init__(self, motor_gain: float | None, speed: SpeedSource) -> None:
        """motor_gain: acceleration per ampere [rad/s^2/A]; None: as the estimator knows it."""
        self._motor_gain = motor_gain
        self._raw = speed == "raw"
        self._timeline = Timeline()
        self._speed_rad_s: float | None = None
        self._lasted_s = 0.0
        self._pushed_rad_s = 0.0

    def step(self, tick: Tick, known: WheelKnown) -> tuple[float, float] | None:
        """Interval [s] and the mean drag over it [rad/s^2], signed as the speed is; None: nothing was learned."""
        step = self._timeline.step(tick)
        speed_rad_s = self._usable(tick, known)
        if step is None or self._speed_rad_s is None or tick.estimate.outcome is Outcome.RESEEDED:
            self._begin(speed_rad_s)
            return None
        dt_s, current_A = step
        self._lasted_s += dt_s
        gain = known.parameters.motor_gain if self._motor_gain is None else self._motor_gain
        self._pushed_rad_s += gain * current_A * dt_s
        if speed_rad_s is None:
            return None
        lasted_s = self._lasted_s
        drag_rad_s2 = (self._pushed_rad_s - (speed_rad_s - self._speed_rad_s)) / lasted_s
        self._begin(speed_rad_s)
        return lasted_s, min(max(drag_rad_s2, -_LARGEST_RAD_S2), _LARGEST_RAD_S2)

    def asked(self, current_A: float) -> float:
        """Note what is asked for [A], for wheels whose telemetry has no current; returns it."""
        return self._timeline.asked(current_A)

    def _usable(self, tick: Tick, known: WheelKnown) -> float | None:
        if not self._raw:
            return known.speed_rad_s
        return None if tick.estimate.outcome in _UNUSABLE else tick.sample.speed_rad_s

    def _begin(self, speed_rad_s: float | None) -> None:
        self._speed_rad_s = speed_rad_s
        self._lasted_s = self._pushed_rad_s = 0.0
