"""Wheels that speak lines of text, as an Arduino does, and their map (docs/wire-protocol.md#lines-of-text)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from pydantic import Field as Key
from pydantic import field_validator, model_validator

from rw_ekf.checking.findings import Where
from rw_ekf.checking.section import NOT_NULL, Mistake, refuse
from rw_ekf.drivers.line.ascii_layout import AsciiFraming, AsciiRegister
from rw_ekf.drivers.line.ascii_template import ADDRESS, IGNORED, Template
from rw_ekf.drivers.line.framing import Codec
from rw_ekf.drivers.line.register_protocol import AddressedRegisterProtocol, of_content
from rw_ekf.drivers.line.serial_link import SerialLink
from rw_ekf.drivers.line.wire_layout import IdRanges, Name
from rw_ekf.drivers.line.wire_map import STATUSES, WireMap
from rw_ekf.errors import ConfigError

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.register_server import RegisterServer

FIRST_READ = 128  # ids are given here: no line has one
_MOST_REGISTERS = 100


class AsciiMap(WireMap):
    """A wire map of lines of text."""

    framing: AsciiFraming = AsciiFraming()  # type: ignore[assignment]
    ids: ClassVar[IdRanges] = IdRanges(write=(0, FIRST_READ - 1), read=(FIRST_READ, 255))  # type: ignore[misc]
    statuses: ClassVar[dict[int, str]] = STATUSES  # type: ignore[misc]
    registers: tuple[AsciiRegister, ...] = Key(strict=False, description="what can be asked and commanded")
    refusals: dict[Name, str] = Key({}, description="name: line, of answers to what is not done")
    startup: tuple[str, ...] = Key((), strict=False, description="lines that make the wheel take commands")
    restarted: Annotated[str | None, NOT_NULL] = Key(None, description="the line that the wheel sends when it starts")
    ignored: tuple[str, ...] = Key((), strict=False, description="lines that say nothing of use")

    @field_validator("registers", mode="before")
    @classmethod
    def _numbered(cls, registers: Any) -> Any:
        """Give each an id, by which the program knows it; a line has none."""
        if not isinstance(registers, list | tuple):
            return registers
        if len(registers) > _MOST_REGISTERS:
            refuse([((), f"are {len(registers)}; {_MOST_REGISTERS} at most")])
        found: list[Any] = []
        for index, register in enumerate(registers):
            if not isinstance(register, dict):
                found.append(register)
                continue
            if "id" in register:
                refuse([((index, "id"), "is of no use here: a line has its words instead; leave it out")])
            found.append(register | {"id": index + (FIRST_READ if register.get("access") == "read" else 0)})
        return found

    @field_validator("registers")
    @classmethod
    def _safe(cls, registers: tuple[AsciiRegister, ...], info: Any) -> tuple[AsciiRegister, ...]:
        """What text itself does not bound must be bounded by the map."""
        framing: AsciiFraming | None = info.data.get("framing")
        mistakes: list[Mistake] = []
        for index, register in enumerate(registers):
            for at, field in enumerate(register.fields):
                place = (index, "fields", at)
                if field.name == "current_command" and register.access == "write":
                    if field.range is None:
                        words = "has no range, and text carries any number: give range: [lowest, highest] in the unit"
                        mistakes.append(((*place, "name"), words))
                    elif not field.range[0] <= 0.0 <= field.range[1]:
                        mistakes.append(((*place, "range"), "does not hold 0, which must always be commanded"))
                exposed = framing is not None and not framing.has_checksum and register.access == "read"
                if field.name == "speed" and exposed:
                    mistakes += [
                        ((*place, "name"), f"needs {key}: without a checksum nothing else shows a missing digit")
                        for key in ("range", "most_per_s")
                        if getattr(field, key) is None
                    ]
            mistakes += _unaddressed(index, register, framing)
        refuse(mistakes)
        return registers

    @model_validator(mode="after")
    def _readable(self) -> Self:
        texts: list[tuple[tuple[str | int, ...], str]] = [(("refusals", name), t) for name, t in self.refusals.items()]
        texts += [(("startup", index), text) for index, text in enumerate(self.startup)]
        texts += [(("ignored", index), text) for index, text in enumerate(self.ignored)]
        texts += [] if self.restarted is None else [(("restarted",), self.restarted)]
        mistakes: list[Mistake] = []
        for path, text in texts:
            try:
                made = self._lines[text] = Template(text)
            except ValueError as error:
                mistakes.append((path, str(error)))
                continue
            if any(slot.name != ADDRESS and (slot.name != IGNORED or path[0] == "startup") for slot in made.slots):
                mistakes.append((path, "has a place for a number, of which nothing is known here"))
            mistakes += [
                (path, f"is also what register {register.name} answers")
                for register in self.registers
                if path[0] != "startup" and register._answers is not None and register._answers.read(text) is not None
            ]
        refuse(mistakes)
        return self

    def model_post_init(self, context: Any) -> None:
        """Lines have no order of bytes."""

    def codec(self) -> Codec:
        """For one end of a line."""
        from rw_ekf.drivers.line.ascii_codec import AsciiCodec

        return AsciiCodec(self)

    def open_line(self, *line: Any) -> SerialLink:
        """A line on which it is spoken."""
        from rw_ekf.drivers.line.ascii_link import AsciiLink

        settings, *more = line
        return AsciiLink(settings, self, *more)

    @cached_property
    def _lines(self) -> dict[str, Template]:
        return {}

    def line(self, text: str) -> Template:
        """The template of one of refusals, restarted, ignored."""
        return self._lines[text]

    @property
    def refused(self) -> dict[int, str]:
        """Statuses and lines of refusals; those that the register family knows too have the same status."""
        known = {name: status for status, name in STATUSES.items()}
        return {known.get(name, 16 + at): text for at, (name, text) in enumerate(self.refusals.items())}

    def status_name(self, status: int) -> str:
        """The map's word for a refusal."""
        names = dict(zip(self.refused, self.refusals, strict=True))
        return names.get(status, super().status_name(status))


def _unaddressed(index: int, register: AsciiRegister, framing: AsciiFraming | None) -> list[Mistake]:
    """Lines that bear no address where others do, or a place for one that is not known."""
    if framing is None:
        return []
    lines = {"request": register._asks, "reply": register._answers}
    with_place = {key: line.slot(ADDRESS) is not None for key, line in lines.items() if line is not None}
    place = f"{{{ADDRESS}:d}}"
    if framing.address is None:
        lacks = f"has a place {place}: give framing.address, before which wheel.address of a configuration goes"
        return [((index, key), lacks) for key, has in with_place.items() if has]
    lacks = f"has no {place}, and framing.address is given: another wheel on the line would be taken for this one"
    return [((index, key), lacks) for key, has in with_place.items() if not has]


class AsciiProtocol(AddressedRegisterProtocol):
    """A WheelProtocol over such a map; its lines bear an address where the map gives one."""

    undescribed = "lines of text have no fields of a fixed size, so its requests and replies are what there is to give"

    wire_map: AsciiMap

    @property
    def electronics(self) -> type[RegisterServer]:
        """What answers in a simulated wheel."""
        from rw_ekf.drivers.sim.ascii_server import AsciiServer

        return AsciiServer

    def at(self, address: int) -> Self:
        """As of any, of a map whose lines have a place for it."""
        if self.address is None:
            raise ConfigError(
                f"is {address}, but the lines of the wire map have no place {{address:d}}: write it into each request "
                "and reply, and give framing.address, or drop it"
            )
        return super().at(address)


def protocol_of(data: Mapping[str, object], where: Where) -> AsciiProtocol:
    """Make the protocol of a map's content. Raises ConfigError with every finding."""
    return of_content(AsciiProtocol, AsciiMap, data, where)
