"""Wheels on a CAN bus (`family: can`), as a map of messages describes them (docs/wire-protocol.md#can).

The map becomes the registers that the rest of the program knows: what stands where, checked together. What is sent at
one moment (`cycle`) is one register, `cycle`; a value reported at its own pace is a register of its name; `status` and
`identity` are what they are on a serial line. Commands are the registers that write.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from pydantic import PrivateAttr

from rw_ekf.checking.findings import Where, checked
from rw_ekf.driver import WireLimits
from rw_ekf.drivers.can.can_check import MapCheck, signal_field, used_messages
from rw_ekf.drivers.can.can_database import database_of, folder_of
from rw_ekf.drivers.can.can_file import FLAG_BITS, CanFile, FrameCare
from rw_ekf.drivers.can.can_frames import MessageCodec
from rw_ekf.drivers.line.register_protocol import RegisterProtocol
from rw_ekf.drivers.line.unacknowledged_commands import STATUSES
from rw_ekf.drivers.line.wire_layout import Field, Register
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.errors import ConfigError

if TYPE_CHECKING:
    from rw_ekf.drivers.line.line import Line
    from rw_ekf.drivers.sim.register_server import RegisterServer

RESET_ID, COMMAND_ID, IDLE_ID = 1, 3, 10
IDENTITY_ID, STATUS_ID, CYCLE_ID, FIRST_OWN_ID = 128, 130, 137, 140
IDENTITY = ("type", "version", "serial_number")


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
    findings = MapCheck(file, database).findings()
    if findings:
        raise ConfigError([f"{where(path)}: {'.'.join(map(str, path))} {words}" for path, words in findings])
    sources = _sources(file)
    care = Layout(file, {}, sources).care
    codecs = {name: MessageCodec(database.get_message_by_name(name), care(name)) for name in used_messages(file)}
    registers = []
    for name, number in _numbered(sources):
        fields = [
            signal_field(reported, file.telemetry[reported], database)
            for reported in sources[name]
            if reported not in FLAG_BITS
        ]
        if any(reported in FLAG_BITS for reported in sources[name]):
            fields.append(Field(name="flags", type="u8"))
        registers.append(Register(id=number, name=name, access="read", fields=tuple(fields)))
    fields = [signal_field("current_command", file.command, database)]
    registers.append(Register(id=COMMAND_ID, name="current_command", access="write", fields=tuple(fields)))
    if file.idle is not None:
        fields = [Field(name="mode", type="u8")]
        registers.append(Register(id=IDLE_ID, name="mode", access="write", fields=tuple(fields)))
    if file.reset is not None:
        fields = [Field(name="key", type="u8", constant=0.0)]
        registers.append(Register(id=RESET_ID, name="reset", access="write", fields=tuple(fields)))
    made = CanMap(name=file.name, link=file.link, statuses=STATUSES, registers=tuple(registers))
    made._layout = Layout(file, codecs, sources)
    return made


def _sources(file: CanFile) -> dict[str, dict[str, Source]]:
    """By register, what it holds, and where that stands."""
    found: dict[str, dict[str, Source]] = {}
    for name, reported in file.telemetry.items():
        message, signal = reported.signal.split(".")
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


class CanProtocol(RegisterProtocol):
    """A WheelProtocol over such a map."""

    undescribed = (
        "a CAN map's messages are those of its DBC, or of `messages` in it: give that to the ground system as it is"
    )

    wire_map: CanMap

    @property
    def limits(self) -> WireLimits:
        """What the messages can carry, and how often they come."""
        file = self.wire_map.layout.file
        watchdog = file.command.watchdog_ms
        return super().limits._replace(
            telemetry_s=1e-3 * file.cycle.period_ms, command_within_s=None if watchdog is None else 1e-3 * watchdog
        )

    @property
    def electronics(self) -> type[RegisterServer]:
        """What answers in a simulated wheel."""
        from rw_ekf.drivers.sim.can_server import CanServer

        return CanServer


def protocol_of(data: Mapping[str, object], where: Where) -> CanProtocol:
    """Make the protocol of a map's content. Raises ConfigError with every finding."""
    content = {key: value for key, value in data.items() if key != "family"}
    file = checked(CanFile, content, "a map of CAN messages", where)
    made = can_map(file, database_of(file, where), where)
    stated = json.dumps(content, sort_keys=True).encode()
    if file.dbc is not None:
        stated += (folder_of(where) / file.dbc).read_bytes()
    return CanProtocol(made, _scale_places(file, where), hashlib.sha256(stated).hexdigest())


def _scale_places(file: CanFile, where: Where) -> dict[str, str]:
    """Where the scales of speed and current stand: file:line and signal, or the DBC."""
    places = {}
    for word, text in (("speed", file.telemetry["speed"].signal), ("current", file.command.signal)):
        message, name = text.split(".")
        place = str(folder_of(where) / str(file.dbc))
        for i, one in enumerate(file.messages):
            for k, signal in enumerate(one.signals):
                if (one.name, signal.name) == (message, name):
                    place = where(("messages", i, "signals", k, "scale")).rsplit(":", 1)[0]
        places[word] = f"{place} (scale of {name} in message {message})"
    return places
