"""What a driver is to those above it: a wheel that is read and commanded, and what is spoken on its line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol, runtime_checkable

from rw_ekf.clock import Clock
from rw_ekf.records import IssuedCommand, LinkCounters, WheelIdentity, WheelSample

# Why a command is not what was requested (IssuedCommand.reason), beside the words of a wire map.
TIMEOUT = "timeout"
ACTED_THOUGH = "acted_though_"  # and the word of the refusal
OPPOSITE = "opposite"  # telemetry reports the current that was written with the other sign
ZERO_BY_MODE = "zero_by_mode_idle"
ZERO_BY_RESET = "zero_by_reset"


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
        """Write one current. Only the guard of rw_ekf.live.guard may call this.

        Acknowledged: the current that is reported is in force, though it may be another than was requested (reason).
        """
        ...

    def stop_current(self, by: str | None = None) -> IssuedCommand:
        """Write zero, and where the wheel refuses it let go of the current by whatever else it takes.

        by: ZERO_BY_MODE or ZERO_BY_RESET: in that way alone. Acknowledged: the wheel says so. Only the guard may call
        this.
        """
        ...

    def close(self) -> None:
        """Release the line. Safe to call twice."""
        ...


class ControlLines(NamedTuple):
    """What the modem lines of a serial port are set to when it is opened, and stay at."""

    dtr: bool = True
    rts: bool = True


USUAL_LINES = ControlLines()


class WireLimits(NamedTuple):
    """What a wheel's wire can carry."""

    current_A: tuple[float, float]  # lowest and highest that can be commanded
    speed_rad_s: tuple[float, float]  # lowest and highest that can be read
    speed_step_rad_s: float = 0.0  # resolution of a reading; 0: none
    hottest_degC: float | None = None  # None: no temperature in telemetry
    current_unit: str = "A"  # "N m" where a torque stands in place of the current
    tells_current: bool = True  # whether telemetry has the current, commanded or measured
    telemetry_s: float | None = None  # how often telemetry comes unrequested [s]; None: on request
    command_within_s: float | None = None  # the wheel lets go of a current that is not repeated so soon [s]


class WheelProtocol(Protocol):
    """What is spoken on the line of one family of wheels; rw_ekf.drivers.protocols has them all."""

    scale_places: Mapping[str, str]  # where in its file the scales of "speed" and "current" stand
    fingerprint: str | None  # sha256 of what is spoken: signs, scales, units; None: of no file

    @property
    def limits(self) -> WireLimits:
        """What it can carry."""
        ...

    def open_wheel(
        self,
        port: str,
        clock: Clock,
        reply_timeout_s: float,
        *,
        baud: int | None = None,
        probe: bool = True,
        exclusive: bool = True,
        control: ControlLines = USUAL_LINES,
        previous: WheelDriver | None = None,
    ) -> WheelDriver:
        """Open a wheel. Raises DriverError: no such port, busy, no permission, nobody answers.

        probe: wait until it answers. exclusive: refuse a port that another process has locked. control: what DTR and
        RTS are set to. previous: the wheel that was lost on this port; counters, clock and segments continue from it.
        """
        ...

    def serve(self, plant: Any, link_path: str, **options: Any) -> None:
        """Serve a simulated wheel of this family on a pseudo-terminal at link_path until a signal."""
        ...


class WireItem(NamedTuple):
    """One number of a packet: value in `unit` = number on the wire * scale + offset."""

    name: str
    type: str  # u8, i8, u16, i16, u32, i32, f32
    low_byte_first: bool
    meaning: str = ""
    unit: str = ""  # as the wire map has it: rpm, mA; "": none
    scale: float = 1.0
    offset: float = 0.0
    constant: float | None = None  # on the wire; of a reply, what distinguishes it from others
    states: Mapping[int, str] = {}  # what its numbers are called
    crc: WireCrc | None = None  # what it is the checksum of: all items before it


class WireCrc(NamedTuple):
    """A reflected CRC of 16 bits, in the order in which standards have its polynomial."""

    polynomial: int
    start: int
    final: int


class WirePacket(NamedTuple):
    """What stands between the marks of a frame, escapes undone."""

    name: str
    is_command: bool  # else a reply
    items: tuple[WireItem, ...]
    meaning: str


@runtime_checkable
class DescribedProtocol(Protocol):
    """A protocol whose packets can be written down for other programs."""

    @property
    def packets(self) -> tuple[WirePacket, ...]:
        """Requests and replies."""
        ...


@runtime_checkable
class StartedByWrite(Protocol):
    """A family whose wheel waits, after power-up, for a write that starts its program."""

    def reading_only(self) -> WheelProtocol:
        """The same, but that a wheel that waits is not started: its reads raise NotStartedError."""
        ...
