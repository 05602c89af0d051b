"""The records that pass between the stages: bytes -> WheelSample -> Estimate -> Tick -> sinks. Frozen, SI, named."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple, Protocol

from rw_ekf.errors import BadInputError

if TYPE_CHECKING:
    from rw_ekf.arrays import Float64Array

# What a wheel may say of itself (WheelSample.conditions).
FAULT = "fault"
OVER_TEMPERATURE = "over_temperature"
CURRENT_LIMITED = "current_limited"
OTHER_MODE = "other_mode"  # than the one in which it takes currents
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
    reason: str | None = None  # why it differs from what was requested ("clamped", "slew", "over_speed", ...)
    heeded: bool = True  # False: the wheel refuses currents, or nothing says that it takes them


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
    foreign: int = 0  # frames on a shared bus that claim to be of this wheel or this program, and are not
    echoes_lost: int = 0  # of requests whose echo (wheel.echo) did not come back as they were sent
    bus_errors: int = 0  # that the controller of a bus reported
    bus: str | None = None  # what that controller is: active, warning, passive, off; None: no bus, or it does not say
    trouble: str | None = None  # why the link is lost, while it is
    # What replies took beyond the time of their bytes on the line, over some fifty of them [ms]: what an adapter adds.
    reply_ms: float | None = None
    reply_jitter_ms: float | None = None  # mean distance from it
    reply_ms_max: float | None = None  # since the line was first opened

    def note_reply(self, took_ms: float) -> None:
        """Count in how long a reply took."""
        if self.reply_ms is None or self.reply_jitter_ms is None or self.reply_ms_max is None:
            self.reply_ms, self.reply_jitter_ms, self.reply_ms_max = took_ms, 0.0, took_ms
            return
        off_ms = took_ms - self.reply_ms
        self.reply_ms += off_ms / 50.0
        self.reply_jitter_ms += (abs(off_ms) - self.reply_jitter_ms) / 50.0
        self.reply_ms_max = max(self.reply_ms_max, took_ms)


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


class WheelState(NamedTuple):
    """Speed and the four parameters per unit inertia; also of their standard deviations."""

    speed_rad_s: float
    motor_gain: float  # rad/s^2/A
    viscous: float  # 1/s
    coulomb: float  # rad/s^2
    static: float  # rad/s^2


class ParameterFlags(NamedTuple):
    """A yes or no for each of the four parameters."""

    motor_gain: bool
    viscous: bool
    coulomb: bool
    static: bool


class Believed(NamedTuple):
    """A number and its standard deviation, in the number's unit."""

    value: float
    std: float


class HiddenState(NamedTuple):
    """What an effect with a memory holds; None where the model has no such effect."""

    current_A: float | None = None  # in the winding, behind a lag
    friction_rad_s2: float | None = None  # of a bristle or a friction lag, signed as the speed is


class Conditions(NamedTuple):
    """What the model takes from the sample besides the speed, the last known of each."""

    temperature_degC: float
    angle_rad: float
    columns: tuple[float, float, float] = (0.0, 0.0, 0.0)  # that learned laws of the model are functions of


class FilterTrouble(StrEnum):
    """What is wrong with a filter (docs/filter.md#health)."""

    NOT_FINITE = "not_finite"  # a state or a variance is no number
    NOT_POSITIVE = "covariance_not_positive"
    RAN_AWAY = "ran_away"  # a parameter, or the speed, where no wheel is
    DIVERGED = "diverged"  # innovations of one sign, many times their sigma, for a minute
    LOCKED_OUT = "locked_out"  # every reading refused for long
    UNPHYSICAL = "unphysical"  # a motor gain or a Coulomb friction below zero, by five sigma


class FilterReset(StrEnum):
    """What was reset."""

    NOTHING = "nothing"
    SPEED = "speed"  # seeded from the reading
    PARAMETERS = "parameters"  # the last good ones with wider sigmas, and the speed
    ALL = "all"  # everything as at the start


@dataclass(frozen=True, slots=True)
class FilterHealth:
    """What is wrong with the filter, from the sample at which it was noticed until it is well again."""

    trouble: FilterTrouble
    reset: FilterReset
    text: str  # one sentence
    time_s: float  # of that sample
    beyond_mending: bool  # reset so often of late that only a person helps


_NO_FRICTION = "nothing is known of the friction of an estimate that no estimator made"


def _one_speed_rad_s(value: float) -> float:
    """A speed that friction was asked for. Raises BadInputError for what is not one finite number."""
    try:
        if not getattr(value, "ndim", 0) and math.isfinite(value):
            return float(value)
    except (TypeError, ValueError, OverflowError):
        pass
    raise BadInputError(
        f"friction torque: speed_rad_s is {repr(value)[:60]}: give one finite number [rad/s] at a time, or None "
        "for the believed speed"
    )


class Friction(Protocol):
    """The friction torque per unit inertia at a sample, as the filter believes it."""

    def value_rad_s2(self, speed_rad_s: float | None = None) -> float:
        """At the believed speed, or another one [rad/s]."""
        ...

    def believed_rad_s2(self, speed_rad_s: float | None = None) -> Believed:
        """The same with its standard deviation."""
        ...


class Outlook(Protocol):
    """The wheel a little ahead, as the filter propagates it."""

    begin_rad_s: float  # when a command that is issued now acts, ...
    lead_s: float  # ... so long after the sample

    def end_rad_s(self, current_A: float, duration_s: float) -> float:
        """The speed [rad/s] after a current [A] has acted for so long [s]."""
        ...


@dataclass(eq=False, frozen=True, slots=True)
class Estimate:
    """What the filter says after a sample. `innovation` is None where there was no speed to compare with."""

    time_s: float
    outcome: Outcome
    state: WheelState
    std: WheelState
    innovation: Innovation | None = None
    predicted_speed_rad_s: float = 0.0
    effects: Mapping[str, Believed] = field(default_factory=dict)  # coefficients, by id, numbered where one repeats
    hidden: HiddenState | None = None
    conditions: Conditions | None = None
    covariance: Float64Array | None = field(default=None, compare=False, repr=False)  # (n, n), hidden states last
    health: FilterHealth | None = None  # None where all is well
    valid: ParameterFlags | None = None  # which parameters may be relied on (docs/filter.md#what-may-be-relied-on)
    friction: Friction | None = field(default=None, compare=False, repr=False)
    current: Callable[[float], float] | None = field(default=None, compare=False, repr=False)
    ahead: Callable[[float | None], Outlook] | None = field(default=None, compare=False, repr=False)
    inertia_kg_m2: float | None = field(default=None, compare=False, repr=False)  # None: nobody gave it

    @property
    def mean(self) -> WheelState:
        """What is believed, by name; `std` has the standard deviations."""
        return self.state

    def friction_torque_rad_s2(self, speed_rad_s: float | None = None) -> Believed:
        """Friction torque per unit inertia, all effects of the model included: value and standard deviation.

        Above zero it slows a wheel that turns forward. speed_rad_s: at another speed, taken for known, than the
        believed one. Raises BadInputError for what is not one finite number, ValueError for an estimate that no
        estimator made.
        """
        if self.friction is None:
            raise ValueError(_NO_FRICTION)
        return self.friction.believed_rad_s2(None if speed_rad_s is None else _one_speed_rad_s(speed_rad_s))

    def friction_torque(self, speed_rad_s: float | None = None) -> Believed:
        """The same in N m, the inertia taken for known: value and standard deviation.

        Raises BadInputError for such a speed and where nobody gave the inertia, ValueError for an estimate that no
        estimator made.
        """
        if self.inertia_kg_m2 is None:
            raise BadInputError(
                "friction_torque: in N m it goes with the inertia, which is not known: give the Estimator "
                "`inertia_kg_m2`, or take friction_torque_rad_s2, per unit inertia"
            )
        believed = self.friction_torque_rad_s2(speed_rad_s)
        return Believed(self.inertia_kg_m2 * believed.value, self.inertia_kg_m2 * believed.std)

    def friction_value_rad_s2(self, speed_rad_s: float | None = None) -> float:
        """Per unit inertia, without its deviation, in a tenth of the time: what a compensation evaluates each turn."""
        if self.friction is None:
            raise ValueError(_NO_FRICTION)
        return self.friction.value_rad_s2(speed_rad_s)

    def current_for_A(self, drive_rad_s2: float) -> float:
        """The current [A] that drives the wheel by so much, after what the model's effects take from it at once.

        A lag or a delay is not undone. Raises ZeroDivisionError for a motor gain of zero.
        """
        return drive_rad_s2 / self.state.motor_gain if self.current is None else self.current(drive_rad_s2)

    def outlook(self, speed_rad_s: float | None = None) -> Outlook:
        """The wheel from when a command acts that is issued on this sample, as late as the one before it did.

        speed_rad_s: a speed to take for known in place of the believed one. Raises ValueError for an estimate that no
        estimator made.
        """
        if self.ahead is None:
            raise ValueError("nothing is known of what follows an estimate that no estimator made")
        return self.ahead(speed_rad_s)

    @property
    def values(self) -> tuple[float, ...]:
        """State and coefficients, as a table's columns have them."""
        return (*self.state, *(effect.value for effect in self.effects.values()))

    @property
    def stds(self) -> tuple[float, ...]:
        """Their standard deviations, in the same order."""
        return (*self.std, *(effect.std for effect in self.effects.values()))


class LinkState(StrEnum):
    """How the line answered at a tick."""

    ANSWERED = "answered"
    MISSED = "missed"  # no valid reply: the sample has no speed
    SILENT = "silent"  # none for longer than limits.silence_s
    DOWN = "down"  # the port has failed, and is tried again


class RunState(StrEnum):
    """What a run is doing. Which leads to which: rw_ekf.live.run_states."""

    CONNECTING = "CONNECTING"  # the line is there, too few readings yet
    TRACKING = "TRACKING"  # readings come, and the filter takes them
    DEGRADED = "DEGRADED"  # readings are missing or not used, or something is wrong with the wheel
    LOST = "LOST"  # the line is down or silent: zero is written and retried
    SAFE = "SAFE"  # latched: zero only, until a person resumes or restarts the run


class StateNow(NamedTuple):
    """The state of a run, since when, and a sentence why."""

    state: RunState
    since_utc: str
    reason: str


class CompensationNow(NamedTuple):
    """What the friction compensation of a run is doing."""

    scheme: str
    on: bool
    parameters: str  # whose: "filter", "last_trusted", "not_needed" or "nothing"
    share: float  # of the compensation that acts: below 1 while it is faded in
    current_A: float  # that it added to the current of the request alone
    reason: str  # why it is on or off, in a sentence


@dataclass(frozen=True, slots=True)
class ActiveAlarm:
    """An alarm that is on: its name, sentence, beginning, and what else was found."""

    name: str
    text: str
    since_utc: str
    since_s: float
    details: Mapping[str, float | str | None] = field(default_factory=dict)

    def document(self) -> dict[str, float | str | None]:
        """As the state file has it."""
        return {
            "name": self.name,
            "text": self.text,
            "since_utc": self.since_utc,
            "since_s": self.since_s,
            **self.details,
        }


class Alarms(NamedTuple):
    """What a watch says after a turn: the alarms that are on, and those that ended with it, what was found of them."""

    on: tuple[ActiveAlarm, ...] = ()
    over: tuple[ActiveAlarm, ...] = ()


@dataclass(frozen=True, slots=True)
class Tick:
    """One turn of the loop. A controller gets it before a command is issued, a sink behind that.

    alarms: those that are on; a controller sees them as they were after the turn before. alarms_over: those that ended
    with this turn. state: None in a replay, which drives nothing. fresh: False where the line gave nothing that belongs
    into a log (it is down or silent): sample and estimate are then the last there were. compensation: None where the
    run has none.
    """

    sample: WheelSample
    estimate: Estimate
    command: IssuedCommand | None = None  # that follows the sample; None: none is known
    alarms: tuple[ActiveAlarm, ...] = ()
    link: LinkState = LinkState.ANSWERED
    state: StateNow | None = None
    fresh: bool = True
    compensation: CompensationNow | None = None
    alarms_over: tuple[ActiveAlarm, ...] = ()
    host_s: float = math.nan  # when the turn was, by the host's monotonic clock; NaN in a replay


class Reading(NamedTuple):
    """What a tick brought before anything was made of it; no sample where there is nothing to log."""

    sample: WheelSample | None
    link: LinkState = LinkState.ANSWERED
    quiet_s: float = 0.0  # without telemetry before this tick, by the host's clock
    host_s: float = math.nan  # when the tick was, by the host's monotonic clock


Controller = Callable[[Tick], float]  # the current [A] to request


class Sink(Protocol):
    """Takes every turn of the loop."""

    def write(self, tick: Tick) -> None:
        """Take one turn."""
        ...

    def close(self) -> None:
        """Finish. Safe to call twice."""
        ...
