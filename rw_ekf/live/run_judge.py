"""From a turn of the loop to the state of the run: trouble and danger (docs/contract.md#states-of-a-run)."""

from __future__ import annotations

from rw_ekf.live.guard import BRAKE_ACCELERATES, SafetyLimits
from rw_ekf.live.run_states import RunStates, Turn
from rw_ekf.live.telemetry import STUCK, TelemetryCheck
from rw_ekf.records import OVER_TEMPERATURE, Estimate, IssuedCommand, LinkState, Outcome, Reading, StateNow, WheelSample

_USED = (Outcome.FIRST, Outcome.UPDATED, Outcome.RESEEDED)
_HOT_READINGS = 3  # running above the limit; the guard writes zero at the first, but one reading alone latches nothing
_QUIET_PERIODS = 3.0
SAFE = "safe"  # why a current was replaced by zero

_DANGERS = {
    STUCK: "the speed reading is stuck",
    f"wheel_{OVER_TEMPERATURE}": "the wheel reports over-temperature",
}


class RunJudge:
    """Weighs every turn, and says what the guard must hold back."""

    def __init__(self, states: RunStates, check: TelemetryCheck, limits: SafetyLimits, period_s: float) -> None:
        self._states = states
        self._check = check
        self._limits = limits
        safe_after_s = limits.safe_after_s
        # At a slow rate some periods without a reading are no silence yet.
        self._longest_s = None if safe_after_s is None else max(safe_after_s, _QUIET_PERIODS * period_s)
        self._hot = 0  # readings running above the limit

    @property
    def hold(self) -> str | None:
        """Why nothing but zero may be written."""
        return SAFE if self._states.is_safe else self._check.hold

    def judge(self, reading: Reading, estimate: Estimate | None) -> StateNow:
        """State after this turn; estimate: what the filter made of the sample, None where there was none."""
        used = estimate is not None and estimate.outcome in _USED
        held = self._check.hold
        danger = self._too_quiet(reading) or self._too_hot(reading.sample)
        if held is not None and reading.link is LinkState.ANSWERED:
            danger = danger or _DANGERS.get(held)
        trouble = None if held is None else f"zero is held: {held}"
        health = None if estimate is None else estimate.health
        if health is not None:
            trouble = trouble or health.text
            if health.beyond_mending:
                danger = danger or health.text
        return self._states.step(Turn(reading.link, used, trouble, danger))

    def commanded(self, command: IssuedCommand | None) -> None:
        """Note what became of a request."""
        if command is not None and command.reason == BRAKE_ACCELERATES:
            self._states.latch("above the speed limit the current that should brake the wheel sped it up")

    def _too_quiet(self, reading: Reading) -> str | None:
        if self._longest_s is None or reading.quiet_s <= self._longest_s:
            return None
        return f"no telemetry for more than {self._longest_s:g} s (limits.safe_after_s)"

    def _too_hot(self, sample: WheelSample | None) -> str | None:
        if sample is None or sample.temperature_degC is None:
            return None
        self._hot = 0 if sample.temperature_degC <= self._limits.temperature_degC else self._hot + 1
        if self._hot < _HOT_READINGS:
            return None
        return f"{sample.temperature_degC:.1f} degC, above limits.temperature_degC = {self._limits.temperature_degC:g}"
