"""A map of CAN messages as the registers that the rest of the program knows: what stands where, checked together.

What is told at one moment (`cycle`) is one register, `cycle`; a value told at its own pace is a register of its name;
`status` and `identity` are what they are on a serial line. Commands are the registers that write.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from pydantic import PrivateAttr, ValidationError

from rw_ekf.checking.findings import Where
from rw_ekf.drivers.can.can_database import unit_of
from rw_ekf.drivers.can.can_file import FLAG_BITS, CanFile, FrameCare, Sent, Told
from rw_ekf.drivers.can.can_frames import MessageCodec
from rw_ekf.drivers.line.wire_layout import Field, Register
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.errors import ConfigError

if TYPE_CHECKING:
    from rw_ekf.drivers.line.line import Line

RESET_ID, COMMAND_ID, IDLE_ID = 1, 3, 10
IDENTITY_ID, STATUS_ID, CYCLE_ID, FIRST_OWN_ID = 128, 130, 137, 140
NOT_TAKEN = 1  # status of a write that telemetry does not bear out
_STATUSES = {0: "ok", NOT_TAKEN: "not_taken"}
IDENTITY = ("type", "version", "serial_number")
_TYPES = {False: "u64", True: "i64"}
_FLOATS = {32: "f32", 64: "f64"}


class Source(NamedTuple):
    """Where a field's number comes from."""

    message: str
    signal: str


class Layout(NamedTuple):
    """What a map says, ready for use."""

    file: CanFile
    codecs: Mapping[str, MessageCodec]  # by message
    sources: Mapping[str, Mapping[str, Source]]  # by register and field; flags by their own names

    def messages_of(self, register: str) -> tuple[str, ...]:
        """The messages that a register is made of; of the cycle in the order in which they are sent."""
        if register == "cycle":
            return self.file.cycle.messages
        return tuple(dict.fromkeys(source.message for source in self.sources[register].values()))

    def period_s(self, register: str) -> float:
        """How often its slowest message comes."""
        if register == "cycle":
            return 1e-3 * self.file.cycle.period_ms
        return 1e-3 * max(self.care(message).period_ms for message in self.messages_of(register))

    def care(self, message: str) -> FrameCare:
        """What is known of a message's frames."""
        care = self.file.frames.get(message, FrameCare())
        cycle = self.file.cycle
        return care.model_copy(update={"period_ms": cycle.period_ms}) if message in cycle.messages else care

    @property
    def command(self) -> Source:
        """Where a current is commanded."""
        return Source(*self.file.command.signal.split("."))


class CanMap(WireMap):
    """A wire map made of such a file."""

    _layout: Layout = PrivateAttr()

    @property
    def layout(self) -> Layout:
        """What the file says."""
        return self._layout

    def open_line(self, *line: Any) -> Line:
        """A bus on which it is spoken. Raises DriverError."""
        from rw_ekf.drivers.can.can_link import CanLink

        settings, *more = line
        return CanLink(self, settings, *more)


def can_map(file: CanFile, database: Any, where: Where) -> CanMap:
    """The map of a file whose messages the database has. Raises ConfigError with every finding."""
    findings = [f"{where(path)}: {'.'.join(map(str, path))} {words}" for path, words in _lacks(file, database)]
    if findings:
        raise ConfigError(findings)
    sources = _sources(file)
    care = Layout(file, {}, sources).care
    codecs = {name: MessageCodec(database.get_message_by_name(name), care(name)) for name in _used(file)}
    registers = []
    for name, number in _numbered(sources):
        fields = [_field(told, file, database) for told in sources[name] if told not in FLAG_BITS]
        if any(told in FLAG_BITS for told in sources[name]):
            fields.append(Field(name="flags", type="u8"))
        registers.append(Register(id=number, name=name, access="read", fields=tuple(fields)))
    command = file.command
    keys = Told(signal=command.signal, **({} if command.unit is None else {"unit": command.unit}))
    try:
        fields = [_signal_field("current_command", keys, database)]
    except ValidationError as error:
        raise ConfigError(f"{where(('command',))}: command {error.errors()[0]['msg']}") from None
    registers.append(Register(id=COMMAND_ID, name="current_command", access="write", fields=tuple(fields)))
    if file.idle is not None:
        fields = [Field(name="mode", type="u8")]
        registers.append(Register(id=IDLE_ID, name="mode", access="write", fields=tuple(fields)))
    if file.reset is not None:
        fields = [Field(name="key", type="u8", constant=0.0)]
        registers.append(Register(id=RESET_ID, name="reset", access="write", fields=tuple(fields)))
    made = CanMap(name=file.name, link=file.link, statuses=_STATUSES, registers=tuple(registers))
    made._layout = Layout(file, codecs, sources)
    return made


def _sources(file: CanFile) -> dict[str, dict[str, Source]]:
    """By register, what it tells, and where that stands."""
    found: dict[str, dict[str, Source]] = {}
    for name, told in file.telemetry.items():
        message, signal = told.signal.split(".")
        register = name
        if name in IDENTITY:
            register = "identity"
        elif name == "mode" or name in FLAG_BITS:
            register = "status"
        elif message in file.cycle.messages:
            register = "cycle"
        found.setdefault(register, {})[name] = Source(message, signal)
    return found


def _numbered(sources: Mapping[str, Any]) -> Iterator[tuple[str, int]]:
    """Names and ids of the registers."""
    known = {"cycle": CYCLE_ID, "status": STATUS_ID, "identity": IDENTITY_ID}
    own = iter(range(FIRST_OWN_ID, 256))
    for name in sources:
        yield name, known[name] if name in known else next(own)


def _used(file: CanFile) -> list[str]:
    """The messages that a map speaks of."""
    sent = [s.message for s in (file.enable, file.idle, file.reset, file.cycle.request) if isinstance(s, Sent)]
    told = [told.signal.split(".")[0] for told in file.telemetry.values()]
    return list(dict.fromkeys([*file.cycle.messages, *told, file.command.signal.split(".")[0], *sent]))


def _field(name: str, file: CanFile, database: Any) -> Field:
    return _signal_field(name, file.telemetry[name], database)


def _signal_field(name: str, told: Told, database: Any) -> Field:
    """A signal as a register's field. Raises ValidationError for a unit that does not fit."""
    message, signal_name = told.signal.split(".")
    signal = database.get_message_by_name(message).get_signal_by_name(signal_name)
    kind = _FLOATS[signal.length] if signal.is_float else _TYPES[signal.is_signed]
    field = Field(
        name=name,
        type=kind,
        unit=told.unit if told.unit is not None else unit_of(signal),
        scale=float(signal.scale),
        offset=float(signal.offset),
    )
    if not signal.is_float:
        half = 1 << (signal.length - 1)
        field._numbers = (-half, half - 1) if signal.is_signed else (0, 2 * half - 1)
    return field


# --- what is wrong -------------------------------------------------------------------------------------------------


def _lacks(file: CanFile, database: Any) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Places and words: what the file asks for and the messages do not have, or have otherwise."""
    known = {message.name: message for message in database.messages}

    def signals_of(path: tuple[str | int, ...], name: str) -> Iterator[tuple[tuple[str | int, ...], str]]:
        if name not in known:
            yield path, f"is {name}: there is no such message; there are: {', '.join(sorted(known)) or 'none'}"
        elif known[name].is_multiplexed() or known[name].is_fd or known[name].length > 8:
            yield path, f"is {name}: messages that are multiplexed or longer than 8 bytes are not spoken"

    def signal(path: tuple[str | int, ...], name: str, text: str) -> Iterator[tuple[tuple[str | int, ...], str]]:
        yield from signals_of(path, name)
        if name in known and text not in (names := [one.name for one in known[name].signals]):
            yield path, f"is {text}: message {name} has no such signal; it has: {', '.join(names) or 'none'}"

    def value(path: tuple[str | int, ...], name: str, told: Any) -> Iterator[tuple[tuple[str | int, ...], str]]:
        message, text = told.signal.split(".")
        wrong = list(signal(path, message, text))
        yield from wrong
        if wrong or name in FLAG_BITS:
            return
        try:
            _signal_field(
                name, Told(signal=told.signal, **({} if told.unit is None else {"unit": told.unit})), database
            )
        except ValidationError as error:
            yield path, f"{error.errors()[0]['msg']}: give its unit beside the signal"
        except KeyError:
            yield path, f"is {told.signal}: a float has 32 or 64 bits"

    for name, told in file.telemetry.items():
        yield from value(("telemetry", name), name, told)
    for index, name in enumerate(file.cycle.messages):
        yield from signals_of(("cycle", "messages", index), name)
    yield from value(("command", "signal"), "current_command", file.command)
    for text in file.command.constants:
        yield from signal(("command", "constants", text), file.command.signal.split(".")[0], text)
    for key, sent in (("enable", file.enable), ("idle", file.idle), ("reset", file.reset)):
        if sent is not None:
            yield from signals_of((key, "message"), sent.message)
            for text in sent.signals:
                yield from signal((key, "signals", text), sent.message, text)
    if isinstance(file.cycle.request, Sent):
        yield from signals_of(("cycle", "request"), file.cycle.request.message)
    for name, care in file.frames.items():
        yield from _careless(name, care, known)
    used = [known[name] for name in _used(file) if name in known]
    places = [(message.frame_id, message.is_extended_frame) for message in used]
    for message, place in zip(used, places, strict=True):
        if places.count(place) > 1:
            yield ("telemetry",), f"uses {message.name}, whose identifier another message has too"
    telling = {told.signal.split(".")[0] for told in file.telemetry.values()} | set(file.cycle.messages)
    if file.command.signal.split(".")[0] in telling:
        yield ("command", "signal"), "is in a message that telemetry is in: nobody could tell who sent it"


def _careless(name: str, care: FrameCare, known: Mapping[str, Any]) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """What is wrong with what is said of a message's frames."""
    if name not in known:
        yield ("frames", name), f"is no message; there are: {', '.join(sorted(known)) or 'none'}"
        return
    signals = {signal.name: signal for signal in known[name].signals}
    for key in ("alive", "checksum"):
        text = getattr(care, key)
        if text is not None and text not in signals:
            yield ("frames", name, key), f"is {text}: message {name} has no such signal; it has: {', '.join(signals)}"
        elif text is not None and (signals[text].is_float or signals[text].is_signed or signals[text].length < 2):
            yield ("frames", name, key), f"is {text}: it must be an unsigned number of at least 2 bits"
    summed = signals.get(care.checksum or "")
    if summed is not None:
        first_bit = 0 if summed.byte_order == "little_endian" else 7
        if summed.length != 8 or summed.start % 8 != first_bit:
            yield ("frames", name, "checksum"), f"is {care.checksum}: it must be one whole byte"
