"""Turns of a run for its compensation, without a loop: what a filter believes, and how the run is."""

from __future__ import annotations

from rw_ekf.records import (
    Estimate,
    FilterHealth,
    FilterReset,
    FilterTrouble,
    Outcome,
    ParameterFlags,
    RunState,
    StateNow,
    Tick,
    WheelSample,
    WheelState,
)

ALL = ParameterFlags(motor_gain=True, viscous=True, coulomb=True, static=True)
NONE = ParameterFlags(motor_gain=False, viscous=False, coulomb=False, static=False)
DIVERGED = FilterHealth(FilterTrouble.DIVERGED, FilterReset.NOTHING, "it diverged", 0.0, beyond_mending=False)


def state_of(state: RunState) -> StateNow:
    """A state with a reason."""
    return StateNow(state, "2026-03-01T06:00:00Z", f"why it is {state.value}")


def turn(
    time_s: float,
    state: RunState = RunState.TRACKING,
    *,
    speed: float = 10.0,
    coulomb: float = 0.58,
    gain: float = 15.2,
    valid: ParameterFlags = ALL,
    health: FilterHealth | None = None,
    segment: int = 0,
) -> Tick:
    """A turn at a time [s]."""
    believed = WheelState(speed, gain, 0.003, coulomb, 0.60)
    estimate = Estimate(time_s, Outcome.UPDATED, believed, believed, health=health, valid=valid)
    return Tick(WheelSample(time_s, speed, segment=segment), estimate, state=state_of(state))
