"""How a drag spike goes on: how fast it fades, when it is over, and when the estimator has got over it."""

from __future__ import annotations

import math

from rw_ekf.watch.drag_tracker import DragTracker
from rw_ekf.watch.observation import Observation

FADED = "faded"
_SHORTEST_S = 60.0  # a drag spike decays in minutes or hours; what is gone sooner is another thing
_OVER_SHARE = 0.1  # of the amplitude; a spike is over below it, or below two standard deviations, ...
_OVER_FOR_S = 5.0  # ... for so long of a turning wheel
_BACK_TIME_S = 10.0  # the estimator's own innovations are trusted again when their mean over this time ...
_BACK_MEAN = 0.25  # ... is below so many standard deviations of one of them, ...
_BACK_FOR_S = 30.0  # ... for so long of a turning wheel; ...
_BACK_AT_LATEST_S = 600.0  # ... and whatever they do so long after the spike
_KNOWN_BY = 4.0  # standard deviations that the extra drag must be above zero to tell the decay by
_TURNING_SHARE = 0.3  # of the time: less tells nothing of a decay
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
