"""The online estimator: a WheelSample goes in, an Estimate comes out; commands are noted as they are issued.

Time arrives with the data: no clock is read here. The decisions are those of `decisions`, shared with the compiled
pass over logs.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.errors import FilterError
from rw_ekf.filter import gating
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.ekf import WheelEkf
from rw_ekf.filter.health_monitor import Physician, findings
from rw_ekf.filter.identifiability import Validity
from rw_ekf.filter.interval_inputs import Gatherer, outlook
from rw_ekf.filter.operating_points import OperatingPoints
from rw_ekf.filter.step import Sample
from rw_ekf.model.state import MOTOR_GAIN, PARAMETERS, STATE_SIZE, FrictionParameters
from rw_ekf.records import (
    Believed,
    Estimate,
    HiddenState,
    Innovation,
    IssuedCommand,
    Outcome,
    WheelSample,
    WheelState,
)
from rw_ekf.wheel.effect_table import ABSENT, NO_EFFECTS, EffectSet
from rw_ekf.wheel.momentary_friction import FrictionTorque, current_for, variance_of_known_shapes
from rw_ekf.wheel.pieces import Moment
from rw_ekf.wheel.window import lateness

OUTCOMES = {
    gating.FIRST: Outcome.FIRST,
    gating.UPDATED: Outcome.UPDATED,
    gating.MISSING: Outcome.MISSING,
    gating.GATED: Outcome.GATED,
    gating.REPEATED: Outcome.REPEATED,
    gating.BACKWARD: Outcome.BACKWARD,
    gating.RESEEDED: Outcome.RESEEDED,
}


class Estimator:
    """The extended Kalman filter over speed, four friction parameters and the coefficients of effects."""

    def __init__(
        self,
        constants: FilterConstants,
        mean: Float64Array,
        covariance: Float64Array,
        effects: EffectSet = NO_EFFECTS,
        drift: Float64Array | None = None,
    ) -> None:
        """Start from a belief: mean (n,), covariance (n, n); n is 5 without effects, and grows with each.

        The speed is taken from the first reading. drift: variance rates of the effects' coefficients [unit^2/s].
        """
        if effects.reading_variance > 0.0:
            constants = constants._replace(speed_variance=constants.speed_variance + effects.reading_variance)
        self.constants = constants
        self.ekf = WheelEkf(constants, mean, covariance, effects, drift)
        self._physician = Physician(self.ekf)
        start = Belief(self.mean, self.covariance)
        self.points = OperatingPoints.of_wheel(start.parameters, constants.stribeck.omega_s)
        self._validity = Validity(start)
        remembers = max(self.ekf.table.delay_at, self.ekf.table.window_at) != ABSENT
        self._gatherer = Gatherer(
            remembers=remembers, columns=effects.columns, temperature_lag_s=constants.temperature_lag_s
        )
        self._last: WheelSample | None = None
        self._effects, self._effect_names = effects, effects.state_names
        self._began = self.covariance
        moved = zip(*(way.numbers for way in effects.considered), strict=True)
        self._follow_shapes = [math.fsum(by**2 for by in number) for number in moved]

    @property
    def mean(self) -> Float64Array:
        """Present state, (n,), a copy."""
        return np.array(self.ekf.x)

    @property
    def covariance(self) -> Float64Array:
        """Present covariance, (n, n), a copy."""
        return np.array(self.ekf.P)

    @property
    def parameters(self) -> FrictionParameters:
        """Present friction parameters."""
        return FrictionParameters(*self.ekf.x[PARAMETERS].tolist())

    @property
    def parameter_covariance(self) -> Float64Array:
        """Their covariance, (4, 4), a copy."""
        return np.array(self.ekf.P[PARAMETERS, PARAMETERS])

    @property
    def findings(self) -> list[str]:
        """What had to be reset so far, and why, in sentences; empty where the filter was always well."""
        return findings(self._physician.troubles.elements())

    def command_issued(self, command: IssuedCommand) -> None:
        """Note the current that goes into force after the last sample; without a call the old one holds.

        Raises FilterError on a current or a delay that is not a finite number.
        """
        if not (math.isfinite(command.current_A) and math.isfinite(command.delay_s)):
            raise FilterError(f"a current of {command.current_A} A, {command.delay_s} s late, reached the filter")
        if self._last is not None:
            if not self._gatherer.schedule.knows_current:
                self.ekf.settle_current(command.current_A)
            self._gatherer.schedule.issue(self._last.time_s, command.current_A, command.delay_s)

    def step(self, sample: WheelSample) -> Estimate:
        """Bring the belief to the sample's time and weigh its speed.

        A belief that broke, or a filter that is lost, is reset, and the estimate's `health` says so. Raises FilterError
        on a speed that is infinite.
        """
        last = self._last
        speed = math.nan if sample.speed_rad_s is None else sample.speed_rad_s
        if math.isinf(speed):
            raise FilterError(f"a speed of {speed} rad/s reached the filter")
        begins = last is None or sample.segment != last.segment
        dt = sample.time_s - (sample.time_s - 1.0 if last is None else last.time_s)  # NaN where the time is none
        what = gating.timing(dt, begins)
        if what != gating.UPDATED:
            return self._estimate(sample, what, None)
        if last is None or begins:
            surroundings = self._gatherer.restart()
        else:
            surroundings = self._gatherer.interval(last.time_s, sample.time_s)
        reading = Sample(dt, speed, begins, self._gatherer.schedule.in_force_A)
        before = self.ekf.speed_rad_s
        innovation, predicted = None, math.nan
        try:
            what = self.ekf.predict(reading, surroundings)
            predicted = self.ekf.speed_rad_s
            if what == gating.UPDATED:
                what = self.ekf.update(reading)
                innovation = self._innovation(sample.time_s, what)
        except (ArithmeticError, ValueError):  # where compiled arithmetic leaves NaN
            self.ekf.x[:] = math.nan
        self._gatherer.note(sample, 0.5 * (before + predicted) if self.ekf.is_continuous else 0.0, dt)
        self._last = sample
        if self._physician.examine(reading, sample.time_s, what):
            what = gating.MISSING if math.isnan(speed) else gating.RESEEDED
            if self._physician.has_forgotten:
                self.points.clear()
                self._validity = Validity(Belief(self.mean, self.covariance))
        if what == gating.UPDATED:
            self.points.add(speed, self._gatherer.schedule.in_force_A)
        return self._estimate(sample, what, innovation, predicted)

    def _stds(self) -> list[float]:
        """Of all states, (n,): what is considered of shapes and curves counts (docs/filter.md eq. 7a)."""
        stds: list[float] = self.ekf.std.tolist()
        for i, follows in enumerate(self._follow_shapes, start=MOTOR_GAIN):
            if follows > 0.0:
                known = variance_of_known_shapes(stds[i] ** 2, float(self._began[i, i]), follows)
                stds[i] = math.sqrt(known + follows)
        return stds

    def _innovation(self, time_s: float, what: int) -> Innovation:
        residual, variance = float(self.ekf.y[0, 0]), float(self.ekf.S[0, 0])
        gate = self.constants.gate
        reason = {gating.GATED: "gate", gating.RESEEDED: "reseeded"}.get(what)
        nis = residual * residual / variance
        return Innovation(time_s, residual, math.sqrt(variance), nis, gate, reason is None, reason)

    def _estimate(
        self, sample: WheelSample, what: int, innovation: Innovation | None, predicted: float = math.nan
    ) -> Estimate:
        ekf, table, names = self.ekf, self.ekf.table, self._effect_names
        values, stds = ekf.x.tolist(), self._stds()
        effects: dict[str, Believed] = {}
        if names:
            known = slice(STATE_SIZE, STATE_SIZE + len(names))
            effects = dict(zip(names, map(Believed, values[known], stds[known]), strict=True))
        hidden = None
        if table.hidden:
            hidden = HiddenState(
                None if table.lag_state_at == ABSENT else values[table.lag_state_at],
                None if table.memory_state_at == ABSENT else values[table.memory_state_at],
            )
        given = self._gatherer.given
        conditions = given.conditions
        # The belief stands at the last reading that was used: a time that went back does not move it.
        believed_s = sample.time_s if self._last is None else self._last.time_s
        current_A = self._gatherer.current_A(believed_s - lateness(values, table))
        warmth, angle, columns = conditions
        at = Moment(0.0, current_A, warmth, angle, believed_s, 0.0, columns)
        mean, covariance, stribeck = ekf.x.copy(), ekf.P.copy(), self.constants.stribeck
        return Estimate(
            time_s=sample.time_s,
            outcome=OUTCOMES[what],
            state=WheelState(*values[:STATE_SIZE]),
            std=WheelState(*stds[:STATE_SIZE]),
            innovation=innovation,
            predicted_speed_rad_s=predicted,
            effects=effects,
            hidden=hidden,
            conditions=conditions,
            covariance=covariance,
            health=self._physician.health,
            valid=self._validity.step(values[PARAMETERS], stds[PARAMETERS], self.points.shown),
            friction=FrictionTorque(mean, covariance, table, stribeck, at, self._effects, self._began),
            current=partial(current_for, mean, table, stribeck, at) if names else None,
            ahead=partial(outlook, mean, table, stribeck, given, believed_s),
        )
