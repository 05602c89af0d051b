"""What one sample says to those who watch the residual: the innovation, its variance, and how the filter answered it.

Pure functions of the stream (sample, command that followed it, what the filter made of it): time comes with the data.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rw_ekf.model.friction import CREEP_STRIBECK_SPEEDS
from rw_ekf.records import IssuedCommand, Outcome, Tick, WheelSample, WheelState

# Break-away friction is the parameter the estimator knows worst, and is too sure of (docs/filter.md): what happens at
# low speed under a drive hardly above it is not evidence of anything else.
_CREEP_DRIVE = 0.25  # of Coulomb friction, beyond break-away, ...
_CREEP_SIGMAS = 3.0  # ... or as many of its standard deviations
_LONGEST_STEP_IN_PERIODS = 3.5  # after a longer one the watch begins anew: the line, not the wheel, is in question


class Observation(NamedTuple):
    """One sample, as the watch sees it. `dt_s` is the interval that ended with it."""

    time_s: float
    dt_s: float
    direction: (
        float  # of motion over the whole interval: +1, -1; 0 at rest or where it reversed: nothing is learnt of drag
    )
    speed_rad_s: float  # predicted
    current_A: float  # mean over the interval
    temperature_degC: float  # last known; NaN: never measured
    innovation_rad_s: float  # NaN: none
    variance: float  # of the innovation [rad^2/s^2]; NaN: none
    gain: float  # share of the innovation that the filter's speed took over [-]; 0 where the reading was not used
    keep: float  # share of a deviation in speed that is left at the end of the interval, before the update [-]
    belief: WheelState  # the estimator's state at the interval's start
    coulomb_std: float  # of the estimator's Coulomb friction [rad/s^2], after the sample
    reseeded: bool  # the speed was set to this reading after its innovation had been gated time and again
    restart: bool  # first sample, gap or new segment: what was before says nothing about what follows


class ObservationReader:
    """Turns the stream of a loop's sinks into observations. One of these per run."""

    def __init__(self, speed_variance: float, period_s: float, stribeck_speed_rad_s: float) -> None:
        """speed_variance: R of the filter [rad^2/s^2]; period_s: nominal, of the loop."""
        self._speed_variance = speed_variance
        self._creep_speed = CREEP_STRIBECK_SPEEDS * stribeck_speed_rad_s
        self._longest_s = _LONGEST_STEP_IN_PERIODS * period_s
        self._last: WheelSample | None = None
        self._belief: WheelState | None = None
        self._static_std = 0.0
        self._temperature_degC = math.nan
        self._in_force_A = 0.0
        self._following: IssuedCommand | None = None

    def read(self, tick: Tick) -> Observation | None:
        """Take one turn of the loop; None where the sample's time did not move on."""
        sample, estimate = tick.sample, tick.estimate
        outcome = estimate.outcome
        if outcome in (Outcome.REPEATED, Outcome.BACKWARD):
            return None
        last, belief = self._last, self._belief or estimate.state
        same = last is not None and sample.segment == last.segment
        dt_s = sample.time_s - last.time_s if last is not None and same else 0.0
        current_A, sure = self._current_over(dt_s)
        test = estimate.innovation
        restart = test is None and outcome in (Outcome.FIRST, Outcome.RESEEDED)
        restart = restart or not 0.0 < dt_s < self._longest_s
        predicted = estimate.predicted_speed_rad_s
        turned = predicted * belief.speed_rad_s <= 0.0
        keep = _turned(belief, current_A, predicted) if turned else 1.0 - belief.viscous * dt_s
        direction = 0.0
        if sure and not turned and not (abs(predicted) < self._creep_speed and self._creeps(belief, current_A)):
            direction = 1.0 if predicted > 0.0 else -1.0
        if sample.temperature_degC is not None:
            self._temperature_degC = sample.temperature_degC
        innovation, variance, gain = math.nan, math.nan, 0.0
        if test is not None:
            innovation, variance = test.innovation_rad_s, test.std_rad_s * test.std_rad_s
            if test.accepted:
                gain = 1.0 - self._speed_variance / variance
        self._last, self._belief, self._following = sample, estimate.state, tick.command
        self._static_std = estimate.std.static
        return Observation(
            time_s=sample.time_s,
            dt_s=dt_s,
            direction=direction,
            speed_rad_s=predicted,
            current_A=current_A,
            temperature_degC=self._temperature_degC,
            innovation_rad_s=innovation,
            variance=variance,
            gain=gain,
            keep=keep,
            belief=belief,
            coulomb_std=estimate.std.coulomb,
            reseeded=outcome is Outcome.RESEEDED,
            restart=restart,
        )

    def _current_over(self, dt_s: float) -> tuple[float, bool]:
        """Mean current [A] over the interval that has just ended, and whether the wheel confirmed it."""
        command = self._following
        if command is None or dt_s <= 0.0:
            return self._in_force_A, True
        late = min(max(command.delay_s, 0.0) / dt_s, 1.0)
        mean_A = late * self._in_force_A + (1.0 - late) * command.current_A
        self._in_force_A = command.current_A
        return mean_A, command.acknowledged

    def _creeps(self, belief: WheelState, current_A: float) -> bool:
        """Whether the drive is too little beyond break-away to separate a slow wheel's drag from an error in that."""
        drive = abs(belief.motor_gain * current_A)
        unsure = max(_CREEP_DRIVE * abs(belief.coulomb), _CREEP_SIGMAS * self._static_std)
        return drive < breakaway(belief) + unsure


def breakaway(belief: WheelState) -> float:
    """Break-away friction [rad/s^2]: what the estimator believes, but never less than Coulomb friction."""
    return max(belief.static, belief.coulomb)


def _turned(belief: WheelState, current_A: float, predicted_rad_s: float) -> float:
    """Share of a deviation that outlives a reversal: the saltation factor (docs/model.md eq. 13); at rest, none."""
    drive, static = abs(belief.motor_gain * current_A), abs(belief.static)
    if predicted_rad_s == 0.0 or drive <= static:
        return 0.0
    return (drive - static) / (drive + static)
