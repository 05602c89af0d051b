"""The file of a map of CAN messages (`family: can`): what may stand in it, each part checked alone."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, model_validator
from pydantic import Field as Key

from rw_ekf.checking.section import NOT_NULL, Mistake, Section, matching, one_of, refuse
from rw_ekf.drivers.can.can_frames import CHECKSUMS, EXTENDED_IDS, STANDARD_IDS
from rw_ekf.drivers.line.wire_layout import QUANTITIES, UNITS, LineSettings

# What telemetry may report beside the quantities of any map: signals that are up where they are not zero.
FLAG_BITS = {"fault": 1, "current_limited": 2, "over_temperature": 4}
REPORTED = (*(name for name in QUANTITIES if name not in ("flags", "speed_reference")), *FLAG_BITS)

Identifier = Annotated[str, matching(r"[A-Za-z_][A-Za-z0-9_]*", "write a name in letters, digits and _")]
Place = Annotated[str, matching(r"[A-Za-z_]\w*\.[A-Za-z_]\w*", "write Message.Signal")]


class CanSignal(Section):
    """One number in a message, as a DBC has it: value in `unit` = number on the wire * scale + offset."""

    name: Identifier = Key(description="what the signal is called")
    start: int = Key(ge=0, le=511, description="its start bit, counted as a DBC does")
    length: int = Key(ge=1, le=64, description="bits")
    byte_order: Literal["little", "big"] = "little"
    type: Literal["unsigned", "signed", "float"] = "unsigned"
    scale: float = Key(1.0, description="unit per count")
    offset: float = Key(0.0, description="value at count 0, in the unit")
    unit: Annotated[str, one_of(UNITS)] = "none"

    @model_validator(mode="after")
    def _holds(self) -> Self:
        mistakes: list[Mistake] = []
        if self.scale == 0.0:
            mistakes.append((("scale",), "must not be 0: the value could not be written"))
        if self.type == "float" and self.length not in (32, 64):
            mistakes.append((("length",), f"is {self.length}: a float has 32 or 64 bits"))
        refuse(mistakes)
        return self


class CanMessage(Section):
    """One message."""

    name: Identifier = Key(description="what the message is called")
    id: int = Key(ge=0, lt=EXTENDED_IDS, description="its identifier on the bus")
    extended: bool = False
    length: int = Key(8, ge=0, le=8, description="data bytes")
    signals: tuple[CanSignal, ...] = Key((), strict=False, description="what is in it")

    @model_validator(mode="after")
    def _holds(self) -> Self:
        if not self.extended and self.id >= STANDARD_IDS:
            refuse([(("id",), f"is {self.id:#x}: a standard identifier is below 0x800; say extended: true")])
        return self


def _as_table(value: Any) -> Any:
    return {"signal": value} if isinstance(value, str) else value


class Reported(Section):
    """Where a value stands."""

    signal: Place = Key(description="Message.Signal")
    unit: Annotated[str | None, NOT_NULL] = None  # else the database's
    of_current: tuple[int, ...] = Key(
        (0, 1), strict=False, description="of `mode`: numbers in which currents are taken"
    )


class FrameCare(Section):
    """What is known of a message's frames beside their content."""

    period_ms: float = Key(1000.0, gt=0, le=60_000, description="from frame to frame, beside the cycle [ms]")
    alive: Annotated[Identifier | None, NOT_NULL] = None
    checksum: Annotated[Identifier | None, NOT_NULL] = None
    algorithm: Annotated[str, one_of(CHECKSUMS)] = "crc8-sae-j1850"
    over_id: bool = False


class Sent(Section):
    """A message with fixed numbers in it, as they are on the wire."""

    message: Identifier = Key(description="which message")
    signals: dict[Identifier, int] = Key({}, description="signal: number on the wire; others are 0")


class CycleKeys(Section):
    """The messages that report one moment, and how often."""

    messages: tuple[Identifier, ...] = Key(
        strict=False, min_length=1, description="in the order in which they are sent"
    )
    period_ms: float = Key(gt=0, le=60_000, description="from cycle to cycle [ms]")
    within_ms: Annotated[float | None, NOT_NULL, Key(gt=0)] = None  # from the first to the last; else half a period
    missing_after: int = Key(3, ge=1, le=1000, description="cycles after which a frame is no news")
    same_alive: bool = Key(False, description="whether the messages of a cycle bear the same count")
    request: Annotated[Literal["remote"] | Sent | None, NOT_NULL] = None  # what has it sent; else it comes unrequested


class CommandKeys(Section):
    """What commands a current."""

    signal: Place = Key(description="Message.Signal")
    unit: Annotated[str | None, NOT_NULL] = None
    constants: dict[Identifier, int] = Key({}, description="other signals of that message, as on the wire")
    confirmed_by: Annotated[Literal["current_command", "current"] | None, NOT_NULL] = None  # else what there is
    tolerance: float = Key(0.0, ge=0, description="by how much what confirms may differ, in A (or N m)")
    watchdog_ms: Annotated[float | None, NOT_NULL, Key(gt=0)] = None  # the wheel lets go without a command


class BusKeys(Section):
    """The bus."""

    bitrate: int = Key(500_000, ge=10_000, le=1_000_000, description="bits a second")


class CanFile(Section):
    """The whole file."""

    name: str = Key("can-wheel", min_length=1, description="what the protocol is called")
    bus: BusKeys = BusKeys()
    link: LineSettings = LineSettings(baud=115_200)
    dbc: Annotated[str | None, NOT_NULL] = None
    messages: tuple[CanMessage, ...] = Key((), strict=False, description="what a DBC would say")
    telemetry: dict[Annotated[str, one_of(REPORTED)], Annotated[Reported, BeforeValidator(_as_table)]] = Key(
        description="value: Message.Signal"
    )
    cycle: CycleKeys = Key(description="the messages that tell of one moment")
    frames: dict[Identifier, FrameCare] = Key({}, description="message: its period, counter and checksum")
    command: CommandKeys = Key(description="what commands a current")
    enable: Annotated[Sent | None, NOT_NULL] = None  # before a current that follows a zero
    idle: Annotated[Sent | None, NOT_NULL] = None  # lets go of the current
    reset: Annotated[Sent | None, NOT_NULL] = None

    @model_validator(mode="after")
    def _holds(self) -> Self:
        mistakes: list[Mistake] = []
        if (self.dbc is None) == (not self.messages):
            mistakes.append((("dbc",), "or messages: exactly one of them says which bits mean what"))
        if "speed" not in self.telemetry:
            mistakes.append((("telemetry",), "needs speed: it is what is estimated from"))
        elif self.telemetry["speed"].signal.partition(".")[0] not in self.cycle.messages:
            mistakes.append((("cycle", "messages"), "must have the message of telemetry.speed"))
        confirmed_by = self.command.confirmed_by
        if confirmed_by is not None and confirmed_by not in self.telemetry:
            mistakes.append((("command", "confirmed_by"), f"is {confirmed_by}, which is not in telemetry"))
        if confirmed_by == "current" and self.command.tolerance == 0.0:
            mistakes.append(
                (("command", "tolerance"), "must be above 0: a measured current is never the one commanded")
            )
        refuse(mistakes)
        return self
