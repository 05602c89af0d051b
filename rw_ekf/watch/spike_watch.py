"""Drag spikes [L17 IV]: abrupt onset, exponential decay. Found within seconds, followed until they are over.

Waiting: the bank looks for an onset in the estimator's innovations. Sure, but not sized: up to four seconds are given
to the amplitude. Following: a tracker holds the extra drag against the parameters from before the onset, and the bank
keeps looking, in the tracker's innovations, for the next spike of a train.
"""

from __future__ import annotations

import math
from collections import deque

from rw_ekf.records import WheelState
from rw_ekf.watch.alarms import DRAG_SPIKE, Alarm
from rw_ekf.watch.observation import Observation
from rw_ekf.watch.onset_bank import Onset, OnsetBank
from rw_ekf.watch.onset_fit import OnsetFit, fit_onset
from rw_ekf.watch.spike_course import FADED, DragTracker, SpikeCourse

LONGEST_ONSET_S = 15.0
_MARGIN = 10.0  # twice the log likelihood ratio to a step of the speed: three sigma of that ratio when it decides
_STILL_SURE = 0.8  # of the threshold
_SIZED = 12.0  # amplitude in standard deviations at which it is reported ...
_SIZED_AFTER_S = 1.0  # ... not before so long after the onset, ...
_REPORTED_AFTER_S = 4.0  # ... and as it is after so long
_AGAIN_AFTER_S = 5.0  # an onset that was none, or too small, is not looked at again for so long
_RETRY_S = 0.5  # a wheel at rest gives an amplitude no sooner by being evaluated more often
_KEPT = 512  # samples for the exact onset
_NEAR_REST = 4.0  # reading noises: below, the wheel may stand still
_USUAL_S = 1800.0  # for so long after what began like a spike and was none ...
_ABOVE_USUAL = 2.0  # ... only what is so much larger is called a spike


class SpikeWatch:
    """Looks for spikes and follows the one that was found. Time and memory per sample do not grow."""

    def __init__(
        self,
        speed_variance: float,
        acceleration_density: float,
        period_s: float,
        threshold: float,
        smallest_share: float,
        inertia_kg_m2: float | None,
    ) -> None:
        """speed_variance, acceleration_density: of the estimator; period_s: of the loop; threshold: of the bank [-].

        smallest_share: of Coulomb friction; a smaller spike is none. inertia_kg_m2: None: torques are not given.
        """
        self._variance, self._noise = speed_variance, acceleration_density
        self._near_rest_rad_s = _NEAR_REST * math.sqrt(speed_variance)
        self._threshold, self._smallest, self._inertia = threshold, smallest_share, inertia_kg_m2
        self._bank = OnsetBank(LONGEST_ONSET_S, period_s)
        self._recent: deque[Observation] = deque(maxlen=_KEPT)
        self._gains: deque[float] = deque(maxlen=_KEPT)
        self._sure = False
        self._quiet_until_s = -math.inf
        self._usual_rad_s2 = 0.0  # amplitude of what began like a spike and was none, lately
        self._usual_until_s = -math.inf
        self._tracker: DragTracker | None = None
        self._course = SpikeCourse(0.0)
        self.active: Alarm | None = None

    @property
    def following(self) -> bool:
        """Whether a spike is on, or the estimator has not got over one yet."""
        return self._tracker is not None

    @property
    def remaining(self) -> tuple[float, float] | None:
        """Extra drag now and its standard deviation [rad/s^2]; None where there is no spike."""
        if self._tracker is None or self.active is None:
            return None
        return self._tracker.drag_rad_s2, self._tracker.std_rad_s2

    def add(self, e: Observation) -> list[Alarm]:
        """Take one sample; return the spikes that began or ended with it."""
        if e.restart:
            self._recent.clear()
            self._gains.clear()
            self._sure = False
            self._quiet_until_s = self._usual_until_s = -math.inf
        seen = e if self._tracker is None else self._tracker.add(e)
        drag_gain = 0.0 if self._tracker is None else self._tracker.drag_gain
        self._recent.append(seen)
        self._gains.append(drag_gain)
        onset = self._bank.add(seen, drag_gain)
        begun = self._look(seen, onset) if onset is not None and e.time_s >= self._quiet_until_s else None
        if begun is not None:
            return self._begin(seen, begun)
        return [] if self._tracker is None else self._follow(self._tracker, e, seen)

    def _look(self, e: Observation, onset: Onset) -> OnsetFit | None:
        """Decide whether an onset is sure, and sized; its fit once it is to be reported."""
        if not self._sure:
            self._sure = onset.statistic > self._threshold and onset.margin > _MARGIN
        elif onset.statistic < _STILL_SURE * self._threshold or onset.margin < 0.0:
            self._sure = False
        age_s = e.time_s - onset.time_s
        sized = onset.statistic > _SIZED and age_s >= _SIZED_AFTER_S
        due = sized or age_s >= _REPORTED_AFTER_S
        if not (self._sure and due and onset.margin > _STILL_SURE * _MARGIN):
            return None
        fit = fit_onset(self._recent, self._gains, e.time_s - 1.5 * age_s - 0.5, self._near_rest_rad_s)
        smallest = self._smallest * abs(e.belief.coulomb)
        if e.time_s < self._usual_until_s:
            smallest = max(smallest, _ABOVE_USUAL * self._usual_rad_s2)
        if fit is not None and fit.amplitude_rad_s2 > smallest and (fit.sized or fit.at_least) and not fit.is_step:
            return fit
        none = fit is not None and (fit.sized or fit.is_step)  # too small, or no drag at all
        self._sure = not none
        self._quiet_until_s = e.time_s + (_AGAIN_AFTER_S if none else _RETRY_S)
        return None

    def _begin(self, e: Observation, fit: OnsetFit) -> list[Alarm]:
        ended = [] if self.active is None else [self._ended(fit.time_s, "another one set in")]
        if ended and self._course.is_short:
            self._remember(e.time_s)
        drag, std = fit.amplitude_rad_s2, fit.std_rad_s2
        if self._tracker is None:
            after = e.speed_rad_s + (1.0 if e.reseeded else e.gain) * e.innovation_rad_s
            speed, reference = after + fit.lag_rad_s, self._belief_before(fit.time_s)
        else:  # the tracker has taken up some of the new spike already: it is left to find the rest
            speed, reference = self._tracker.speed_rad_s, self._tracker.reference
            drag, std = max(drag, self._tracker.drag_rad_s2), drag
        noises = self._variance, self._noise, self._near_rest_rad_s
        self._tracker = DragTracker(reference, speed, drag, std, *noises)
        self._course = SpikeCourse(drag, bound=fit.at_least)
        self.active = Alarm(
            DRAG_SPIKE,
            fit.time_s,
            {
                "amplitude_rad_s2": fit.amplitude_rad_s2,
                "std_rad_s2": None if fit.at_least else fit.std_rad_s2,
                "amplitude_mNm": self._torque_mNm(fit.amplitude_rad_s2),
                "std_mNm": None if fit.at_least else self._torque_mNm(fit.std_rad_s2),
                "inertia_kg_m2": self._inertia,
                "bound": "at least: the wheel stands still" if fit.at_least else None,
                "speed_rad_s": self._belief_before(fit.time_s).speed_rad_s,
                "coulomb_rad_s2": self._tracker.reference.coulomb,
            },
        )
        self._start_afresh()
        return [*ended, self.active]

    def _follow(self, tracker: DragTracker, e: Observation, seen: Observation) -> list[Alarm]:
        """See whether the spike is over; then, whether the estimator has got over it."""
        over = self._course.over(tracker, e, seen)
        if self.active is not None and over is not None:
            ended = self._ended(e.time_s - self._course.low_s, over)
            self.active = None
            if over != FADED:
                self._remember(e.time_s)
            return [ended]
        if self.active is None and self._course.recovered(e.dt_s):
            self._tracker = None
            self._start_afresh()
        return []

    def _remember(self, time_s: float) -> None:
        """Remember what began like a spike and was none: for a while its like is not reported."""
        lately = self._usual_rad_s2 if time_s < self._usual_until_s else 0.0
        self._usual_rad_s2 = max(self._course.amplitude_rad_s2, lately)
        self._usual_until_s = time_s + _USUAL_S

    def _ended(self, time_s: float, why: str) -> Alarm:
        assert self.active is not None
        details = {**self.active.details, "decay_s": self._course.decay_s, "end": why}
        return Alarm(DRAG_SPIKE, self.active.since_s, details, time_s)

    def _start_afresh(self) -> None:
        """The innovations that follow come from another filter."""
        self._bank.clear()
        self._recent.clear()
        self._gains.clear()
        self._sure = False

    def _belief_before(self, time_s: float) -> WheelState:
        """The estimator's state at the start of the interval in which the spike set in."""
        for e in self._recent:
            if e.time_s > time_s:
                return e.belief
        return self._recent[-1].belief

    def _torque_mNm(self, acceleration_rad_s2: float) -> float | None:
        return None if self._inertia is None else 1.0e3 * self._inertia * acceleration_rad_s2
