"""How a drag spike continues: what is left of it, how fast it fades, when it is over, when the estimator is over it.

Speed and extra drag are followed by a filter of two states while a spike lasts. Its model is the estimator's own
prediction, put back to the parameters from before the onset (docs/watch.md eq. 8-9): so it knows every effect that the
estimator knows, and costs no propagation of its own.
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


FADED = "faded"
_SHORTEST_S = 60.0  # a drag spike decays in minutes or hours; what is gone sooner is another thing
_OVER_SHARE = 0.1  # of the amplitude; a spike is over below it, or below two standard deviations, ...
_OVER_FOR_S = 5.0  # ... for so long of a turning wheel
_BACK_TIME_S = 10.0  # the estimator's own innovations are trusted again when their mean over this time ...
_BACK_MEAN = 0.25  # ... is below so many standard deviations of one of them, ...
_BACK_FOR_S = 30.0  # ... for so long of a turning wheel; ...
_BACK_AT_LATEST_S = 600.0  # ... and whatever they do so long after the spike
_KNOWN_BY = 4.0  # standard deviations that the extra drag must be above zero to determine the decay
_TURNING_SHARE = 0.3  # of the time: less shows nothing of a decay
_WRONG_WAY_FOR_S = 1.0
_WRONG_WAY_SHARE = 0.5  # of the amplitude, speeding the wheel up: no drag


class SpikeCourse:
    """One spike, sample by sample."""

    def __init__(self, amplitude_rad_s2: float, *, bound: bool = False) -> None:
        """bound: the amplitude is only known to be larger; then there is no decay time."""
        self.amplitude_rad_s2 = amplitude_rad_s2
        self._bound = bound
        self._elapsed_s = 0.0
        self._turning_s = 0.0
        self.low_s = 0.0  # for so long next to nothing has been left
        self._wrong_s = 0.0
        self._mean = math.inf  # of the estimator's normalised innovations
        self._calm_s = 0.0
        self._after_s = 0.0  # since it was over
        self.decay_s: float | None = None  # by what was left when it first was below 1/e

    @property
    def is_short(self) -> bool:
        """Whether it has not lasted as long yet as a drag spike does."""
        return self._elapsed_s < _SHORTEST_S + _OVER_FOR_S

    def recovered(self, dt_s: float) -> bool:
        """Whether the estimator's innovations have had no mean for a while, or have had long enough to lose it."""
        self._after_s += dt_s
        return self._calm_s > _BACK_FOR_S or self._after_s > _BACK_AT_LATEST_S

    def over(self, tracker: DragTracker, e: Observation, seen: Observation) -> str | None:
        """Take one sample, as the estimator and as the tracker saw it; why the spike is over, or None."""
        self._elapsed_s += e.dt_s
        self._watch_estimator(e)
        if seen.direction == 0.0:
            return None
        self._turning_s += e.dt_s
        drag, std = tracker.drag_rad_s2, tracker.std_rad_s2
        known = not self._bound and drag > _KNOWN_BY * std and self._turning_s > _TURNING_SHARE * self._elapsed_s
        if self.decay_s is None and known and drag < self.amplitude_rad_s2 / math.e:
            self.decay_s = self._elapsed_s / math.log(self.amplitude_rad_s2 / drag)
        wrong = drag < -max(_WRONG_WAY_SHARE * self.amplitude_rad_s2, 3.0 * std)
        self._wrong_s = self._wrong_s + e.dt_s if wrong else 0.0
        low = drag < max(_OVER_SHARE * self.amplitude_rad_s2, 2.0 * std)
        self.low_s = self.low_s + e.dt_s if low else 0.0
        if self._wrong_s > _WRONG_WAY_FOR_S:
            return "acts in one direction only: no drag"
        if self.low_s <= _OVER_FOR_S or wrong:
            return None
        return "gone within a minute: shorter than a drag spike" if self.is_short else FADED

    def _watch_estimator(self, e: Observation) -> None:
        if e.restart or e.direction == 0.0 or math.isnan(e.innovation_rad_s):
            return
        share = min(e.dt_s / _BACK_TIME_S, 1.0)
        value = e.innovation_rad_s / math.sqrt(e.variance)
        self._mean = value if math.isinf(self._mean) else self._mean + share * (value - self._mean)
        self._calm_s = self._calm_s + e.dt_s if abs(self._mean) < _BACK_MEAN else 0.0
