"""What a map of lines of text consists of: what is around a line, its numbers, and the pairs of lines."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field as Key
from pydantic import model_validator

from rw_ekf.checking.section import NOT_NULL, Mistake, Section, refuse
from rw_ekf.drivers.line.ascii_template import ADDRESS, IGNORED, Slot, Template
from rw_ekf.drivers.line.wire_layout import UNITS, Byte, Field, Register

TERMINATORS = {"lf": b"\n", "crlf": b"\r\n", "cr": b"\r"}
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
    address: Byte | None = Key(None, description="what stands at {address:d} of lines; wheel.address goes before it")

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

    @model_validator(mode="after")
    def _holds(self) -> Self:
        if self.range is not None and self.range[0] >= self.range[1]:
            refuse([(("range",), f"goes from {self.range[0]:g} to {self.range[1]:g}: the lowest comes first")])
        return super()._holds()  # type: ignore[operator,no-any-return]

    # Looked up for every reading, and four times as fast as what pydantic calls a private attribute.
    @cached_property
    def _slot(self) -> Slot:
        """Its place in the lines of a register, which sets it."""
        return Slot("", "")

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
    """A query line and the line that answers, or a command line and what acknowledges it."""

    request: str = Key(description="the line that is sent")
    reply: Annotated[str | None, NOT_NULL] = Key(None, description="the line that answers; none: nothing does")
    fields: tuple[AsciiField, ...] = Key((), strict=False, description="what the places of the lines are")

    @cached_property
    def _asks(self) -> Template:
        """The line that is sent."""
        return Template(self.request)

    @cached_property
    def _answers(self) -> Template | None:
        """The line that answers."""
        return None if self.reply is None else Template(self.reply)

    @model_validator(mode="after")
    def _holds(self) -> Self:
        mistakes: list[Mistake] = []
        for key, template in (("request", "_asks"), ("reply", "_answers")):
            try:
                getattr(self, template)
            except ValueError as error:
                mistakes.append(((key,), str(error)))
        refuse(mistakes)
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
        if ADDRESS in names:
            found.append(
                (("fields", names.index(ADDRESS), "name"), "is kept for framing.address; give it another name")
            )
        found += [
            ((key,), f"has the address as a number of any form: write {{{ADDRESS}:d}} or {{{ADDRESS}:02d}}")
            for key, template in (("request", self._asks), ("reply", self._answers))
            if template is not None and (slot := template.slot(ADDRESS)) is not None and slot.digits != 0
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
            if slot.name not in (IGNORED, ADDRESS, *names)
        ]
        if self.access == "read":
            if not names:
                found.append((("fields",), "must be a list with at least one field"))
            if any(slot.name != ADDRESS for slot in self._asks.slots):
                found.append((("request",), "asks, and has a place for a number that nobody knows"))
            elif self._answers is not None and self._answers.read(self._asks.printed({})) is not None:
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
            if slot.name not in (IGNORED, ADDRESS, *names)
        ]
        return found
