"""The drag that a wheel showed since the reading before: the push of its motor less what it gained in speed."""

from __future__ import annotations

from typing import Literal

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.tick_intervals import Timeline
from rw_ekf.records import Outcome, Tick

SpeedSource = Literal["filtered", "raw"]  # the filter's speed, or the reading itself

_FAR_SIGMAS = 10.0
_LARGEST_RAD_S2 = 1.0e6  # no wheel; keeps the sums of an observer finite


class Readings:
    """The readings of the speed, but for one that lies alone and far from where the filter expects it.

    Its gate would not do: it refuses, for seconds and on one side, what a drag makes of the speed that it knows not of.
    """

    def __init__(self) -> None:
        self._far = False

    def usable(self, tick: Tick) -> float | None:
        """The speed [rad/s] of a tick, if it has one that may be used."""
        expected, was_far = tick.estimate.innovation, self._far
        self._far = expected is not None and abs(expected.innovation_rad_s) > _FAR_SIGMAS * expected.std_rad_s
        return None if self._far and not was_far else tick.sample.speed_rad_s


class DragReading:
    """Mean of k I - domega/dt between two usable speeds, whatever was missing between them [rad/s^2].

    Where the motor gain k is a data sheet's, its error is part of the drag, and compensated with it. A gap in time, a
    new segment, and a filter's speed that was seeded afresh begin anew.
    """

    def __init__(self, motor_gain: float | None, speed: SpeedSource) -> None:
        """motor_gain: acceleration per ampere [rad/s^2/A]; None: as the estimator knows it."""
        self._motor_gain = motor_gain
        self._readings = Readings() if speed == "raw" else None
        self._timeline = Timeline()
        self._speed_rad_s: float | None = None
        self._lasted_s = 0.0
        self._pushed_rad_s = 0.0

    def step(self, tick: Tick, known: WheelKnown) -> tuple[float, float] | None:
        """Interval [s] and the mean drag over it [rad/s^2], signed as the speed is; None: nothing was learned."""
        step = self._timeline.step(tick)
        filtered = self._readings is None
        speed_rad_s = known.speed_rad_s if self._readings is None else self._readings.usable(tick)
        seeded = filtered and tick.estimate.outcome is Outcome.RESEEDED
        if step is None or self._speed_rad_s is None or seeded:
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

    def wanted(self, current_A: float) -> float:
        """Note what is requested [A], for wheels whose telemetry has no current; returns it."""
        return self._timeline.wanted(current_A)

    def _begin(self, speed_rad_s: float | None) -> None:
        self._speed_rad_s = speed_rad_s
        self._lasted_s = self._pushed_rad_s = 0.0
