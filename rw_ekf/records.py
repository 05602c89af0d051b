"""The records that pass between the stages: bytes -> WheelSample -> StepResult -> sinks. Frozen, SI, named."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol, runtime_checkable

# What a wheel may say of itself (WheelSample.conditions).
FAULT = "fault"
OVER_TEMPERATURE = "over_temperature"
CURRENT_LIMITED = "current_limited"
CONDITIONS_THAT_STOP = (FAULT, OVER_TEMPERATURE)  # in which no current but zero is written


@dataclass(frozen=True, slots=True)
class WheelSample:
    """One reading of the wheel. None is a value that was not measured or did not arrive."""

    time_s: float  # of the speed reading; wheel time where the wheel has a clock, else host time
    speed_rad_s: float | None
    current_A: float | None = None  # measured
    current_command_A: float | None = None  # as telemetry reports it, in force when the speed was read
    temperature_degC: float | None = None
    pressure_Pa: float | None = None
    bus_voltage_V: float | None = None
    angle_rad: float | None = None
    status: int | None = None
    segment: int = 0  # changes where the wheel's clock restarted or jumped: speed re-seeded, parameters kept
    conditions: frozenset[str] = frozenset()  # FAULT and its like, as the wheel itself says
    news: tuple[str, str] | None = None  # what the driver noticed with this reading: event, sentence


@dataclass(frozen=True, slots=True)
class IssuedCommand:
    """A current that went to the wheel: in force from `delay_s` after the last sample's time until the next one."""

    current_A: float
    delay_s: float = 0.0
    acknowledged: bool = True  # False: the wheel did not confirm it; the old current may still hold
    reason: str | None = None  # why it differs from what was asked for ("clamped", "slew", "over_speed", ...)


@dataclass(frozen=True, slots=True)
class WheelIdentity:
    """Who answers on the line, as far as the wheel says."""

    kind: int | None = None
    version: int | None = None
    serial_number: int | None = None
    uptime_s: float | None = None


@dataclass(slots=True)
class LinkCounters:
    """What happened on the line since it was first opened (the `link` object of `run --json`)."""

    requests: int = 0
    timeouts: int = 0
    stale: int = 0
    damaged: int = 0
    reconnects: int = 0


@runtime_checkable
class WheelDriver(Protocol):
    """A wheel, real, simulated or replayed. DriverError: the link failed; EndOfRecord: a replay is over."""

    source: str  # "serial+/dev/ttyUSB0", "sim+in-process", "replay+run_012.csv": no record hides where it came from
    link: LinkCounters
    identity: WheelIdentity | None

    def read(self, timeout_s: float) -> WheelSample | None:
        """Take the next sample; None: nothing valid came within `timeout_s`."""
        ...

    def command_current(self, current_A: float) -> IssuedCommand:
        """Write one current. Only the guard of rw_ekf.live.guard may call this."""
        ...

    def close(self) -> None:
        """Release the line. Safe to call twice."""
        ...


class Outcome(StrEnum):
    """What became of a sample."""

    FIRST = "first"  # the state was seeded from it
    UPDATED = "updated"
    MISSING = "missing"  # no speed: prediction only
    GATED = "gated"  # innovation beyond the gate: not used
    REPEATED = "repeated"  # same time as the one before: skipped
    BACKWARD = "backward"  # earlier than the one before: skipped
    RESEEDED = "reseeded"  # after a long gap, a new segment, or a run of gated samples


@dataclass(frozen=True, slots=True)
class Innovation:
    """The test of a sample against its prediction; kept whether or not the sample was used."""

    time_s: float
    innovation_rad_s: float
    std_rad_s: float
    nis: float
    gate: float
    accepted: bool
    reason: str | None = None


@dataclass(frozen=True, slots=True)
class StepResult:
    """What the filter says after a sample. `innovation` is None where there was no speed to compare with."""

    time_s: float
    outcome: Outcome
    mean: tuple[float, ...]  # in the order of rw_ekf.model.state.StateIndex
    std: tuple[float, ...]
    innovation: Innovation | None = None
    predicted_speed_rad_s: float = 0.0
    notes: tuple[str, ...] = field(default=())
