"""The map of a wheel that speaks lines of text: what is asked, what is answered, and what stands in it."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field as Key
from pydantic import PrivateAttr, field_validator, model_validator

from rw_ekf.checking.section import NOT_NULL, Mistake, Section, refuse
from rw_ekf.drivers.line.ascii_template import IGNORED, Slot, Template
from rw_ekf.drivers.line.framing import Codec
from rw_ekf.drivers.line.serial_link import SerialLink
from rw_ekf.drivers.line.wire_layout import UNITS, Field, IdRanges, Name, Register
from rw_ekf.drivers.line.wire_map import STATUSES, WireMap

FIRST_READ = 128  # ids are given here: no line has one
TERMINATORS = {"lf": b"\n", "crlf": b"\r\n", "cr": b"\r"}
_MOST_REGISTERS = 100
_UPTIME_WRAPS = 2.0**32  # millis() and micros() of an Arduino


class AsciiFraming(Section):
    """What is around every line."""

    terminator: Literal["lf", "crlf", "cr"] = Key(
        "lf", description="what ends a request: \\n, \\r\\n or \\r; a reply may end in any of them"
    )
    checksum: Literal["none", "xor", "xor-decimal", "crc16-mcrf4xx", "crc16-x25", "crc16-kermit", "crc16-modbus"] = Key(
        "none", description="what follows a * behind each line"
    )
    prompt: str = Key("", max_length=16, description="what the wheel writes to say that it listens")
    echoes: bool = Key(False, description="whether the wheel repeats each request before it answers")

    @property
    def has_checksum(self) -> bool:
        """Whether a line says by itself that it is whole."""
        return self.checksum != "none"


class AsciiField(Field):
    """One number of a line, in the place of its name: value in `unit` = number * scale + offset."""

    type: ClassVar[str] = "text"  # type: ignore[misc]
    constant: ClassVar[None] = None  # type: ignore[misc]
    range: Annotated[tuple[float, float] | None, NOT_NULL] = Key(
        None, strict=False, description="[lowest, highest] in the unit"
    )
    most_per_s: Annotated[float | None, NOT_NULL] = Key(None, gt=0.0, description="by how much it changes in a second")
    _slot: Slot = PrivateAttr(Slot("", ""))

    @model_validator(mode="after")
    def _holds(self) -> Self:
        if self.range is not None and self.range[0] >= self.range[1]:
            refuse([(("range",), f"goes from {self.range[0]:g} to {self.range[1]:g}: the lowest comes first")])
        return super()._holds()  # type: ignore[operator,no-any-return]

    @property
    def code(self) -> str:
        """A double: what was printed."""
        return "d"

    @property
    def is_float(self) -> bool:
        """Whether its place takes any number of digits."""
        return self._slot.digits is None

    @property
    def numbers(self) -> tuple[float, float]:
        """Those of its range."""
        if self.range is None:
            return -math.inf, math.inf
        ends = [(end - self.offset) / self.scale for end in self.range]
        return min(ends), max(ends)

    @property
    def si_per_count(self) -> float:
        """What its last digit is worth."""
        return super().si_per_count * 10.0 ** -(self._slot.digits or 0)

    @property
    def si_span(self) -> float:
        """A counter of milliseconds or microseconds has 32 bits."""
        return _UPTIME_WRAPS * self.si_per_count if self.name == "uptime" else math.inf

    def rounded(self, number: float) -> float:
        """What stands in a line of it."""
        return number if self.is_float or not math.isfinite(number) else round(number, self._slot.digits) + 0.0

    def saturated(self, number: float) -> float:
        """As it is: a line carries everything."""
        if self.name == "uptime" and not self.is_float and math.isfinite(number):
            number %= _UPTIME_WRAPS
        return self.rounded(number)

    def is_possible(self, value_si: float) -> bool:
        """Whether it is within its range."""
        low, high = self.si_range
        return low <= value_si <= high

    def most_change_si(self, within_s: float) -> float:
        """What the map says, and two of its last digit."""
        if self.most_per_s is None:
            return math.inf
        return self.most_per_s * UNITS[self.unit][1] * within_s + (0.0 if self.is_float else 2.0 * self.si_per_count)

    @property
    def is_believed_twice(self) -> bool:
        """A wheel may have been out of sight."""
        return True


class AsciiRegister(Register):
    """A line that asks and the line that answers, or one that commands and what acknowledges it."""

    request: str = Key(description="the line that is sent")
    reply: Annotated[str | None, NOT_NULL] = Key(None, description="the line that answers; none: nothing does")
    fields: tuple[AsciiField, ...] = Key((), strict=False, description="what the places of the lines are")
    _asks: Template = PrivateAttr()
    _answers: Template | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _holds(self) -> Self:
        mistakes: list[Mistake] = []
        templates: dict[str, Template] = {}
        for key in ("request", "reply"):
            text = getattr(self, key)
            try:
                if text is not None:
                    templates[key] = Template(text)
            except ValueError as error:
                mistakes.append(((key,), str(error)))
        refuse(mistakes)
        self._asks, self._answers = templates["request"], templates.get("reply")
        refuse(self._mistakes())
        for field in self.fields:
            slot = (self._answers if self.access == "read" else self._asks).slot(field.name)  # type: ignore[union-attr]
            assert slot is not None
            field._slot = slot
        return self

    def _mistakes(self) -> list[Mistake]:
        """What does not fit together."""
        names = [field.name for field in self.fields]
        found: list[Mistake] = [
            (("fields", index, "name"), f"is taken: field {name} stands twice in this register")
            for index, name in enumerate(names)
            if name in names[:index]
        ]
        if self.access == "read" and self._answers is None:
            return [*found, (("reply",), "is required where access is read: the line that answers, e.g. RPM={speed}")]
        key, carrier = ("reply", self._answers) if self.access == "read" else ("request", self._asks)
        assert carrier is not None
        found += [
            (("fields", index, "name"), f"has no place: write {{{name}}} where it stands in the {key}")
            for index, name in enumerate(names)
            if carrier.slot(name) is None
        ]
        found += [
            ((key,), f"has a place {{{slot.name}}} and no field of that name; {{_}} stands for what is ignored")
            for slot in carrier.slots
            if slot.name not in (IGNORED, *names)
        ]
        if self.access == "read":
            if self._asks.slots:
                found.append((("request",), "asks, and has a place for a number that nobody knows"))
            elif self._answers is not None and self._answers.read(self.request) is not None:
                found.append((("reply",), "fits the request too: its echo would be taken for an answer"))
            return found
        found += [
            (
                ("request",),
                f"commands {slot.name} without its digits: write {{{slot.name}:.3f}}, or as the wheel takes it",
            )
            for slot in self._asks.slots
            if slot.digits is None
        ]
        found += [
            (("reply",), f"has a place {{{slot.name}}} that the request does not have")
            for slot in (self._answers.slots if self._answers is not None else ())
            if slot.name != IGNORED and slot.name not in names
        ]
        return found


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
    _lines: dict[str, Template] = PrivateAttr(default_factory=dict)

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
            if any(slot.name != IGNORED for slot in made.slots) or (path[0] == "startup" and made.slots):
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
