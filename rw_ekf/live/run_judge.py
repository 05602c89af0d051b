"""From a turn of the loop to the state of the run: trouble and danger (docs/contract.md#states-of-a-run)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from rw_ekf.live.guard import BRAKE_ACCELERATES, SafetyLimits, SpeedLimit
from rw_ekf.live.run_states import RunStates, Turn
from rw_ekf.live.telemetry import STUCK, TelemetryCheck
from rw_ekf.model.friction import Stribeck
from rw_ekf.records import (
    OTHER_MODE,
    OVER_TEMPERATURE,
    Estimate,
    FilterTrouble,
    IssuedCommand,
    LinkState,
    Outcome,
    Reading,
    RunState,
    StateNow,
    WheelSample,
)
from rw_ekf.watch.charge_speed import ChargeSpeed
from rw_ekf.watch.sign_watch import SignWatch
from rw_ekf.watch.stuck_watch import ParameterBelief

_USED = (Outcome.FIRST, Outcome.UPDATED, Outcome.RESEEDED)
_HOT_READINGS, _HOT_AMONG = 3, 10  # above the limit; the guard writes zero at each, but one alone latches nothing
_QUIET_PERIODS = 3.0
_RESEEDS = 5.0  # turns in which a filter takes up readings again that are right again
_SAFE_AFTER_S = 5.0  # where limits.safe_after_s is null: that key is about silence, not about wrong readings
_SIGN_WITHIN_S = 20.0  # the sign watch takes 3 to 21 s under every profile (docs/telemetry.md)
_FORGIVEN = 0.25  # of its time a good turn takes from that of bad ones: one in five may be wild
_GAIN_MAY = 1.2  # the limit's share for readings: with 1.25 for what is not known of the gain this keeps 1.5 L
_KNOWN = 0.2  # of a gain, its sigma
_LEAST_SHARE = 0.05
SAFE = "safe"  # why a current was replaced by zero

_DANGERS = {
    STUCK: "the speed reading is stuck",
    f"wheel_{OVER_TEMPERATURE}": "the wheel reports over-temperature",
}


class Patience:
    """Adds up how long something has been wrong; what is right in between takes back a quarter of its time."""

    def __init__(self, longest_s: float) -> None:
        self._longest_s = longest_s
        self._bad_s = 0.0

    def is_over(self, bad: bool, dt_s: float) -> bool:
        """Take a turn of dt_s; whether it has been too long."""
        self._bad_s = self._bad_s + dt_s if bad else max(self._bad_s - _FORGIVEN * dt_s, 0.0)
        self._bad_s = min(self._bad_s, self._longest_s + dt_s)  # what is right again is right soon
        return self._bad_s > self._longest_s + 0.5 * dt_s


class RunJudge:
    """Weighs every turn, and says what the guard must hold back."""

    def __init__(
        self,
        states: RunStates,
        check: TelemetryCheck,
        limits: SafetyLimits,
        period_s: float,
        sign: SignWatch,
        belief: Callable[[], ParameterBelief],
        *,
        tells_temperature: bool,
        stribeck: Stribeck | None,
    ) -> None:
        """sign: the watch over the gain. belief: what the estimator believes at present.

        stribeck: None where the model has effects besides, and the four parameters are not all of the friction.
        """
        self._states = states
        self._check = check
        self._limits = limits
        self._period_s = period_s
        self._sign = sign
        self._belief = belief
        self._stribeck = stribeck
        self._driven: ParameterBelief | None = None  # what was believed when the wheel was driven last
        self._tells_temperature = tells_temperature
        self._charge = ChargeSpeed(sign.expected)
        safe_after_s = limits.safe_after_s
        # At a slow rate some periods without a reading are no silence yet.
        self._longest_s = None if safe_after_s is None else max(safe_after_s, _QUIET_PERIODS * period_s)
        longest_s = max(_SAFE_AFTER_S if safe_after_s is None else safe_after_s, _QUIET_PERIODS * period_s)
        self._refused = Patience(longest_s + _RESEEDS * period_s)
        self._off, self._unheeded = Patience(longest_s), Patience(longest_s)
        self._unheated_s, self._longest_unheated_s = 0.0, longest_s
        self._turned = Patience(_SIGN_WITHIN_S)
        self._known_share = 1.0
        self._hot: deque[bool] = deque(maxlen=_HOT_AMONG)
        self._command_A = 0.0
        self._last: WheelSample | None = None

    @property
    def hold(self) -> str | None:
        """Why nothing but zero may be written."""
        return SAFE if self._states.is_safe else self._check.hold

    def speed_limit(self) -> SpeedLimit:
        """What else than the reading the guard holds against the speed limit."""
        return SpeedLimit(self._charge.speed_rad_s, self._share())

    def slowing(self, speed_rad_s: float) -> tuple[float, float] | None:
        """The friction at a speed, as it was believed while a current was in force last, and its sigma [rad/s^2].

        What was learnt from coasting is no judge of whether the wheel coasts. None where nothing is to be believed.
        """
        if self._driven is None or self._stribeck is None or not self._driven.is_physical:
            return None
        return self._driven.friction(speed_rad_s, *self._stribeck)

    def judge(self, reading: Reading, estimate: Estimate | None) -> StateNow:
        """State after this turn; estimate: what the filter made of the sample, None where there was none."""
        used = estimate is not None and estimate.outcome in _USED
        held = self._check.hold
        if reading.sample is not None:
            self._follow(reading.sample)
        danger = self._too_quiet(reading) or self._too_hot(reading.sample) or self._too_wrong(estimate)
        if held is not None and reading.link is LinkState.ANSWERED:
            danger = danger or _DANGERS.get(held)
        trouble = None if held is None else f"zero is held: {held}"
        trouble = trouble or self._check.current_fault
        if reading.sample is not None and OTHER_MODE in reading.sample.conditions:
            trouble = trouble or "the wheel is not in the mode in which it takes currents"
        health = None if estimate is None else estimate.health
        if health is not None:
            trouble = trouble or health.text
            if health.beyond_mending:
                danger = danger or health.text
        if self._is_unphysical(estimate):
            danger = danger or (health.text if health is not None else None)
        return self._states.step(Turn(reading.link, used, trouble, danger))

    def _is_unphysical(self, estimate: Estimate | None) -> bool:
        """Whether the readings are no wheel's; a negative gain is the sign watch's first, which names the wire map."""
        health = None if estimate is None else estimate.health
        wrong = health is not None and health.trouble is FilterTrouble.UNPHYSICAL
        turned = estimate is not None and estimate.state.motor_gain < 0.0
        return self._turned.is_over(wrong and turned, self._period_s) or (wrong and not turned)

    def commanded(self, command: IssuedCommand | None) -> None:
        """Note what became of a request."""
        if command is None:
            return
        self._command_A = command.current_A
        if command.current_A != 0.0 and self._states.now.state is RunState.TRACKING:
            self._driven = self._belief()
        if command.reason == BRAKE_ACCELERATES:
            self._states.latch("above the speed limit the current that should brake the wheel sped it up")
        if self._unheeded.is_over(not command.heeded, self._period_s):
            self._states.latch(
                f"the wheel is read but takes no commands ({command.reason}): it refuses them or answers none, and "
                "nothing says that one is in force"
            )

    def _follow(self, sample: WheelSample) -> None:
        """Let the charge that was written carry its speed on to this sample."""
        last, self._last = self._last, sample
        if last is None or sample.segment != last.segment:
            self._charge.anchor(sample.speed_rad_s)
            return
        dt_s, current_A = self._check.interval or (sample.time_s - last.time_s, self._command_A)
        if self._sign.is_right:
            gain, std = self._sign.gain
            self._charge.show_gain(gain - 2.0 * std)
        self._charge.step(dt_s, current_A, sample.speed_rad_s, self._belief())

    def _share(self) -> float:
        """Of the speed limit for readings: a gain that has become smaller may be a scale that has."""
        gain, std = self._sign.gain
        largest = max(abs(self._sign.expected.motor_gain), self._charge.shown_gain)
        if self._sign.is_known and largest > 0.0 and std < _KNOWN * abs(gain):  # else what was known last counts
            self._known_share = min(max(_GAIN_MAY * gain / largest, _LEAST_SHARE), 1.0)
        return self._known_share

    def _too_quiet(self, reading: Reading) -> str | None:
        if self._longest_s is None or reading.quiet_s <= self._longest_s:
            return None
        return f"no telemetry for more than {self._longest_s:g} s (limits.safe_after_s)"

    def _too_hot(self, sample: WheelSample | None) -> str | None:
        if sample is None:
            return None
        limit = self._limits.temperature_degC
        # A bearing warms in minutes, so that one temperature now and then is enough, on a line that loses many.
        reported = sample.temperature_degC is not None or not self._tells_temperature
        self._unheated_s = 0.0 if reported else self._unheated_s + self._period_s
        if self._unheated_s > self._longest_unheated_s:
            return (
                f"no temperature that a wheel can have was read for long: limits.temperature_degC = {limit:g} cannot "
                "be kept. If the wheel has no such sensor, take the field out of the wire map"
            )
        if sample.temperature_degC is not None:
            self._hot.append(not sample.temperature_degC <= limit)
        if sum(self._hot) < _HOT_READINGS:
            return None
        return f"{sum(self._hot)} of {len(self._hot)} readings above limits.temperature_degC = {limit:g}"

    def _too_wrong(self, estimate: Estimate | None) -> str | None:
        """What is wrong with the readings for so long that they are no telemetry."""
        if estimate is None:
            return None
        reseeded = estimate.outcome is Outcome.RESEEDED and estimate.innovation is not None
        if self._refused.is_over(reseeded or estimate.outcome is Outcome.GATED, self._period_s):
            return (
                "the filter refuses the speed readings: they do not follow from the currents, so they are no telemetry"
            )
        fault = self._check.current_fault
        if self._off.is_over(fault is not None, self._period_s):
            return fault
        return self._check.restarts_again
