"""A turn of the loop as other programs take it: the rows of the log and of the estimates by name, with a UTC stamp."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from rw_ekf.clock import Clock
from rw_ekf.json_output import finite
from rw_ekf.logs.log_columns import LOG_COLUMNS
from rw_ekf.logs.writer import INNOVATION_COLUMNS, sample_values
from rw_ekf.model.state import STATE_UNITS
from rw_ekf.records import Estimate, Outcome, StateNow, Tick, WheelSample
from rw_ekf.sinks.events import Happenings

_WITHIN_NS = 60_000_000_000  # the least delay of a minute is none
_STEP_NS = 1_000_000_000  # a stamp that is earlier by less is put behind the one before


class Field(NamedTuple):
    """What a name stands for."""

    kind: str  # of JSON
    unit: str
    meaning: str


def _number(unit: str, meaning: str) -> Field:
    return Field("number", unit, meaning)


SAMPLE_FIELDS: Mapping[str, Field] = {
    "time_s": _number("s", "time of the speed reading, monotonic within a segment"),
    "speed_rad_s": _number("rad/s", "measured speed"),
    "current_command_A": _number("A", "current in force from time_s + command_delay_s until the next sample"),
    "current_A": _number("A", "measured current"),
    "command_delay_s": _number("s", "from time_s until current_command_A takes force"),
    "segment": Field("integer", "", "time and speed may jump where it changes"),
    "temperature_degC": _number("degC", "bearing temperature"),
    "pressure_Pa": _number("Pa", "case pressure"),
    "bus_voltage_V": _number("V", "bus voltage"),
    "angle_rad": _number("rad", "rotor angle"),
    "status": Field("integer", "", "status word of the wheel"),
}
_INNOVATION_FIELDS = {
    "innovation_rad_s": _number("rad/s", "measured less predicted speed"),
    "innovation_std_rad_s": _number("rad/s", "standard deviation of the innovation"),
    "nis": _number("", "normalised innovation squared, chi-square of one degree of freedom"),
    "accepted": Field("boolean", "", "whether the reading was used"),
    "reason": Field("string", "", "why it was not"),
}


def estimate_fields(state_names: tuple[str, ...]) -> dict[str, Field]:
    """Names of an estimate with this state, effects of the model behind the five."""
    units = {name: STATE_UNITS.get(name, "") for name in state_names}
    values = {name: _number(units[name], f"estimated {name}") for name in state_names}
    sigmas = {f"std_{name}": _number(units[name], f"standard deviation of {name}") for name in state_names}
    outcome = Field("string", "", "what became of the sample")
    return {"time_s": SAMPLE_FIELDS["time_s"], **values, **sigmas, **_INNOVATION_FIELDS, "outcome": outcome}


@dataclass(frozen=True)
class TickRecord:
    """A turn. Values are numbers, texts, truths, or None for what is not known; never NaN."""

    stamp_ns: int  # UTC of the speed reading, as nearly as the host knows; never the same twice
    sample: dict[str, Any] | None  # None where the log has no row
    estimate: dict[str, Any] | None
    events: list[dict[str, Any]]
    state: str | None  # of the run


class TickRecords:
    """Makes records of a run's turns, one after the other.

    Stamps follow the wheel's clock, so that what a queue or a disk delays is not in them: a turn comes here late and
    never early, so that the least difference of the host's clock is the true one. Where turns were lost a new segment
    begins, as in the log.
    """

    def __init__(self, clock: Clock, began: StateNow, state_names: tuple[str, ...]) -> None:
        self._clock = clock
        self._happenings = Happenings(clock, began)
        self._state_names = state_names
        self.first: dict[str, Any] = self._happenings.first
        self._offset_ns: int | None = None  # of UTC from the wheel's clock
        self._segment = 0
        self._least_ns = self._since_ns = 0  # of such differences, since when
        self._stamp_ns = 0
        self._breaks = 0

    def of(self, tick: Tick) -> TickRecord:
        """The next turn."""
        is_row = tick.fresh and tick.estimate.outcome not in (Outcome.REPEATED, Outcome.BACKWARD)
        return TickRecord(
            self._stamp(tick.sample if tick.fresh else None),
            self._sample(tick.sample, tick) if is_row else None,
            self._estimate(tick.estimate) if is_row else None,
            finite(self._happenings.of(tick)),
            None if tick.state is None else tick.state.state.value,
        )

    def lost(self, turns: int) -> None:
        """Some were lost: what was commanded meanwhile is not known."""
        self._breaks += 1

    def end(self) -> TickRecord:
        """The end of the run, an event alone."""
        return TickRecord(self._stamp(None), None, None, [self._happenings.end()], None)

    def now_ns(self) -> int:
        """UTC [ns since 1970]."""
        now = self._clock.utc()
        return int(now.timestamp()) * 1_000_000_000 + now.microsecond * 1000

    def _stamp(self, sample: WheelSample | None) -> int:
        stamp_ns = self.now_ns() if sample is None else self._utc_of(sample)
        if 0 <= self._stamp_ns - stamp_ns < _STEP_NS:
            stamp_ns = self._stamp_ns + 1
        self._stamp_ns = stamp_ns
        return stamp_ns

    def _utc_of(self, sample: WheelSample) -> int:
        now_ns, wheel_ns = self.now_ns(), round(sample.time_s * 1e9)
        offset_ns = now_ns - wheel_ns
        if self._offset_ns is None or sample.segment != self._segment:
            self._segment, self._offset_ns = sample.segment, offset_ns
            self._least_ns, self._since_ns = offset_ns, now_ns
        self._least_ns = min(self._least_ns, offset_ns)
        if now_ns - self._since_ns >= _WITHIN_NS:  # the wheel's clock may be slower than the host's
            self._offset_ns = self._least_ns
            self._least_ns, self._since_ns = offset_ns, now_ns
        self._offset_ns = min(self._offset_ns, offset_ns)
        return wheel_ns + self._offset_ns

    def _sample(self, sample: WheelSample, tick: Tick) -> dict[str, Any]:
        reported = replace(sample, segment=sample.segment + self._breaks) if self._breaks else sample
        return dict(zip(LOG_COLUMNS, map(_finite, sample_values(reported, tick.command)), strict=True))

    def _estimate(self, estimate: Estimate) -> dict[str, Any]:
        test = estimate.innovation
        tested = (
            (None,) * 3 if test is None else (test.innovation_rad_s, test.std_rad_s, test.nis)
        ) + (estimate.outcome in (Outcome.UPDATED, Outcome.FIRST), None if test is None else test.reason)  # fmt: skip
        names = ("time_s", *self._state_names, *(f"std_{name}" for name in self._state_names), *INNOVATION_COLUMNS)
        values = (estimate.time_s, *estimate.values, *estimate.stds, *tested)
        found = dict(zip(names, map(_finite, values), strict=True))
        return found | {"outcome": estimate.outcome.value}


def _finite(value: Any) -> Any:
    """A number as Python's own; None for what is none."""
    if isinstance(value, bool | int | str) or value is None:
        return value
    return float(value) if math.isfinite(value) else None
