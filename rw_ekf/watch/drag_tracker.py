"""What is left of a drag spike: speed and extra drag, followed by a filter of two states while a spike lasts.

Its model is the estimator's own prediction, put back to the parameters from before the onset (docs/watch.md eq. 8-9):
so it knows every effect that the estimator knows, and costs no propagation of its own.
"""

from __future__ import annotations

import math

from rw_ekf.records import WheelState
from rw_ekf.watch.observation import Observation

_WANDER = (
    0.01  # of the first amplitude, per sqrt(s): follows a decay of half a minute, and averages over some ten seconds
)
_CLIP = 4.0  # standard deviations that one reading counts for at most


class DragTracker:
    """Speed [rad/s] and extra drag [rad/s^2] beyond the reference; P is (speed, speed), (speed, drag), (drag, drag)."""

    def __init__(
        self,
        reference: WheelState,
        speed_rad_s: float,
        drag_rad_s2: float,
        std_rad_s2: float,
        speed_variance: float,
        acceleration_density: float,
        near_rest_rad_s: float,
    ) -> None:
        """reference: the estimator's state before the onset; speed_variance: R [rad^2/s^2].

        acceleration_density: of the speed [rad^2/s^2 per s], as the estimator's. near_rest_rad_s: below this speed the
        wheel may stand still, and its drag shows nowhere.
        """
        self.reference = reference
        self.speed_rad_s = speed_rad_s
        self.drag_rad_s2 = drag_rad_s2
        self._variance = speed_variance
        self._near_rest_rad_s = near_rest_rad_s
        self._noise = acceleration_density
        self._wander = (_WANDER * drag_rad_s2) ** 2
        self._p11, self._p12, self._p22 = speed_variance, 0.0, std_rad_s2**2
        self.drag_gain = 0.0  # of the last update, for the bank that waits for the next onset

    @property
    def std_rad_s2(self) -> float:
        """Standard deviation of the extra drag."""
        return math.sqrt(self._p22)

    def add(self, e: Observation) -> Observation:
        """Take one sample; return it as this filter saw it."""
        self._p22 += self._wander * e.dt_s
        self.drag_gain = 0.0
        if e.restart or e.direction * self.speed_rad_s < self._near_rest_rad_s:
            return self._set_afresh(e)
        speed = e.speed_rad_s + e.keep * (self.speed_rad_s - e.belief.speed_rad_s) + self._moved(e) * e.dt_s
        if e.direction * speed < self._near_rest_rad_s:
            return self._set_afresh(e)
        push = -e.direction * e.dt_s
        self._p11 = e.keep * (e.keep * self._p11 + 2.0 * push * self._p12)
        self._p12 = e.keep * self._p12 + push * self._p22
        self._p11 += push * push * self._p22 + self._noise * e.dt_s
        self.speed_rad_s = speed
        if math.isnan(e.innovation_rad_s):
            return e._replace(speed_rad_s=speed, gain=0.0)
        return self._update(e, e.speed_rad_s + e.innovation_rad_s - speed)

    def _moved(self, e: Observation) -> float:
        """Acceleration [rad/s^2] by which this model differs from the estimator's of the moment (eq. 8)."""
        now, before = e.belief, self.reference
        friction = now.coulomb - before.coulomb - self.drag_rad_s2
        viscous = now.viscous - before.viscous
        motor_gain = now.motor_gain - before.motor_gain
        return e.direction * friction + viscous * e.speed_rad_s - motor_gain * e.current_A

    def _update(self, e: Observation, innovation: float) -> Observation:
        variance = self._p11 + self._variance
        gain, drag_gain = self._p11 / variance, self._p12 / variance
        seen = e._replace(
            speed_rad_s=self.speed_rad_s, innovation_rad_s=innovation, variance=variance, gain=gain, reseeded=False
        )
        limit = _CLIP * math.sqrt(variance)
        used = min(max(innovation, -limit), limit)
        self.speed_rad_s += gain * used
        self.drag_rad_s2 += drag_gain * used
        self._p22 -= drag_gain * self._p12
        self._p12 *= 1.0 - gain
        self._p11 *= 1.0 - gain
        self.drag_gain = drag_gain
        return seen

    def _set_afresh(self, e: Observation) -> Observation:
        """At rest, on a reversal, after a gap: nothing is learnt of the drag, and the speed starts from the reading."""
        if math.isnan(e.innovation_rad_s):
            self.speed_rad_s = e.speed_rad_s
        else:
            self.speed_rad_s = e.speed_rad_s + e.innovation_rad_s
        self._p11, self._p12 = self._variance, 0.0
        return e._replace(direction=0.0, gain=0.0)
