"""The watch over one run: spikes first, because what a spike does to the residual is already known."""

from __future__ import annotations

import math
from typing import NamedTuple

from rw_ekf.records import Tick
from rw_ekf.watch.alarms import Alarm
from rw_ekf.watch.observation import Observation, ObservationReader
from rw_ekf.watch.residual_watch import BLOCK_S, ResidualWatch
from rw_ekf.watch.spike_watch import SpikeWatch

AFTER_SPIKE = "a drag spike that the estimator has to unlearn"
_UNLEARNS_S = 7200.0
_JUMP_S = 60.0
# The estimator's first innovations show how it learns. It has settled when a reading hardly moves the speed any more
# and Coulomb friction is known, or, at steady speed, which never shows that by itself, after a minute's turning.
_SETTLED_GAIN = 0.05
_SETTLED_COULOMB = 0.02
_SETTLED_AFTER_S = 60.0
_SECONDS = 3.6e6  # of 1000 h
# How many independent tests a tick of the bank amounts to, and a block of the residual: measured over healthy simulated
# wheels (docs/watch.md), rounded up.
_TESTS_PER_TICK = 0.5
_TESTS_PER_BLOCK = 12.0


class WatchedFilter(NamedTuple):
    """What the watch has to know of the estimator and its loop."""

    speed_variance: float  # R [rad^2/s^2]
    acceleration_density: float  # [rad^2/s^2 per s]
    stribeck_speed_rad_s: float
    period_s: float
    inertia_kg_m2: float | None  # None: torques are not given


class WatchKnobs(NamedTuple):
    """What a configuration may set (its section `watch`)."""

    false_alarms_per_1000_h: float = 1.0
    window_s: float = 600.0
    smallest_spike_percent: float = 15.0  # of Coulomb friction


class WheelWatch:
    """Takes the loop's stream and says what begins and what ends. Time comes with the data."""

    def __init__(self, about: WatchedFilter, knobs: WatchKnobs) -> None:
        self._reader = ObservationReader(about.speed_variance, about.period_s, about.stribeck_speed_rad_s)
        self._spikes = SpikeWatch(
            about.speed_variance,
            about.acceleration_density,
            about.period_s,
            onset_threshold(knobs.false_alarms_per_1000_h, about.period_s),
            0.01 * knobs.smallest_spike_percent,
            about.inertia_kg_m2,
        )
        self._residual = ResidualWatch(
            about.stribeck_speed_rad_s,
            knobs.window_s,
            dependence_threshold(knobs.false_alarms_per_1000_h, BLOCK_S),
        )
        self._unlearns_until_s = self._last_s = -math.inf
        self._settled = False
        self._turned_s = 0.0

    @property
    def active(self) -> list[Alarm]:
        """Alarms that are on."""
        return [alarm for alarm in (self._spikes.active, self._residual.active) if alarm is not None]

    @property
    def remaining_drag(self) -> tuple[float, float] | None:
        """What is left of a spike and its standard deviation [rad/s^2]; None where there is none."""
        return self._spikes.remaining

    def step(self, tick: Tick) -> list[Alarm]:
        """Take one turn of the loop; return the alarms that began, changed or ended."""
        seen = self._reader.read(tick)
        return [] if seen is None else self.add(seen)

    def add(self, seen: Observation) -> list[Alarm]:
        """Take one sample as it was observed."""
        if not self._settled:
            self._settled = self._settles(seen)
            return []
        news = self._spikes.add(seen)
        if self._spikes.following:
            if news:
                self._residual.forget()
                self._residual.context = AFTER_SPIKE
                self._unlearns_until_s = seen.time_s + _UNLEARNS_S
            return news
        if seen.time_s > self._unlearns_until_s:
            self._residual.context = None
        if not 0.0 <= seen.time_s - self._last_s < _JUMP_S:  # a new segment's clock, or a gap as long as a window
            self._residual.forget()
        self._last_s = seen.time_s
        return news + self._residual.add(seen)

    def _settles(self, e: Observation) -> bool:
        if e.direction != 0.0:
            self._turned_s += e.dt_s
        known = e.coulomb_std < _SETTLED_COULOMB * abs(e.belief.coulomb)
        return 0.0 < e.gain < _SETTLED_GAIN and (known or self._turned_s > _SETTLED_AFTER_S)


def onset_threshold(false_alarms_per_1000_h: float, period_s: float) -> float:
    """Standard deviations at which the onset bank calls a spike [-]: one-sided, half of the false alarms."""
    return _gaussian_tail(0.5 * false_alarms_per_1000_h / (_TESTS_PER_TICK * _SECONDS / period_s))


def dependence_threshold(false_alarms_per_1000_h: float, block_s: float) -> float:
    """Standard deviations at which a dependence of the residual raises the alarm [-]: half of the false alarms."""
    return _gaussian_tail(0.5 * false_alarms_per_1000_h / (_TESTS_PER_BLOCK * _SECONDS / block_s))


def _gaussian_tail(probability: float) -> float:
    """The h with exp(-h^2/2) = probability; at least 3."""
    return math.sqrt(max(-2.0 * math.log(probability), 9.0))
