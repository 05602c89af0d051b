"""Turns of the loop for those who take them, without a loop."""

from __future__ import annotations

from rw_ekf.records import ActiveAlarm, Estimate, IssuedCommand, Outcome, Tick, WheelSample, WheelState

STATE = WheelState(1.0, 15.2, 0.003, 0.58, 0.6)


def tick_of(
    sample: WheelSample,
    command: IssuedCommand | None = None,
    state: WheelState = STATE,
    std: WheelState = STATE,
    alarms: tuple[ActiveAlarm, ...] = (),
) -> Tick:
    """A turn with an ordinary estimate."""
    return Tick(sample, Estimate(sample.time_s, Outcome.UPDATED, state, std), command, alarms)
