"""Turns that go through a recorder as a run makes it, without a run."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from rw_ekf.records import (
    ActiveAlarm,
    Estimate,
    Innovation,
    IssuedCommand,
    Outcome,
    RunState,
    StateNow,
    Tick,
    WheelSample,
    WheelState,
)
from rw_ekf.sinks.all_sinks import SINKS, RunContext
from tests.sinks.test_log_parts import context
from tests.ticks import STATE

TRACKING = StateNow(RunState.TRACKING, "2000-01-01T00:00:01Z", "readings come")
STD = WheelState(0.1, 0.2, 0.0003, 0.04, 0.05)
ALARM = ActiveAlarm("drag_spike", "a spike", "2000-01-01T00:00:02Z", 2.0, {"amplitude_mNm": 0.5})


class Recorder(Protocol):
    """What a test does with one."""

    def write(self, tick: Tick) -> None: ...
    def lost(self, ticks: int) -> None: ...
    def close(self) -> None: ...


def recorder(directory: Path, name: str, value: Any, **output: Any) -> tuple[Any, RunContext]:
    """A recorder of that name, in this thread."""
    made = context(directory, **{name: value, **output})
    parts = SINKS[name].make(made)
    assert parts is not None
    return parts[0], made


def turn(i: int, *alarms: ActiveAlarm, state: StateNow | None = TRACKING, speed_rad_s: float | None = 1.5) -> Tick:
    """The i-th of ten a second."""
    time_s = 100.0 + i / 10
    test = None if speed_rad_s is None else Innovation(time_s, 0.1 / (i + 3), 0.2, 0.25, 6.6, accepted=True)
    outcome = Outcome.MISSING if speed_rad_s is None else Outcome.UPDATED
    estimate = Estimate(time_s, outcome, STATE._replace(speed_rad_s=1.0 / (i + 1)), STD, test)
    sample = WheelSample(time_s, speed_rad_s, current_A=0.1 * i, temperature_degC=20.0, status=3)
    return Tick(sample, estimate, IssuedCommand(0.01 * i, 0.012), alarms, state=state)


def until(condition: Callable[[], Any], within_s: float = 60.0) -> Any:
    """Wait for something of another thread; what it came to."""
    end_s = time.monotonic() + within_s
    while not (found := condition()):
        assert time.monotonic() < end_s, "did not come about in time"
        time.sleep(0.01)
    return found
