"""The map of a VESC: the registers of a wire map are its commands and values (docs/wire-protocol.md#vesc)."""

from __future__ import annotations

import struct
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field as Key
from pydantic import field_validator, model_validator

from rw_ekf.checking.section import NOT_NULL, Mistake, Section, refuse
from rw_ekf.drivers.line.bearing_out import STATUSES
from rw_ekf.drivers.line.framing import Codec
from rw_ekf.drivers.line.line import Line
from rw_ekf.drivers.line.vesc import (
    FIRST_READ,
    IDENTITY_ID,
    SET_CURRENT,
    SET_CURRENT_BRAKE,
    VALUE_BYTES,
    VALUES_ID,
    VescCodec,
)
from rw_ekf.drivers.line.wire_layout import Field, IdRanges, Register
from rw_ekf.drivers.line.wire_map import WireMap

FLAG_FAULT, FLAG_OVER_TEMPERATURE = 1, 4
_CODES = {FLAG_OVER_TEMPERATURE: (5, 6), FLAG_FAULT: (4,)}  # FAULT_CODE_OVER_TEMP_FET, _MOTOR; _ABS_OVER_CURRENT
_CODE_SHIFT = 8
_IDS = {("write", SET_CURRENT), ("write", SET_CURRENT_BRAKE), ("read", IDENTITY_ID), ("read", VALUES_ID)}


class VescFraming(Section):
    """Nothing that wheels of this family differ in."""

    byte_order: Literal["big"] = "big"


class VescCommand(Section):
    """What is known of a current that is commanded."""

    tolerance: float = Key(0.02, gt=0.0, description="of a current in force, as it is told [A]")
    watchdog_ms: Annotated[float | None, NOT_NULL] = Key(
        1000.0, gt=0.0, description="the VESC's own time-out, after which it lets go (timeout_msec of its app settings)"
    )


class VescField(Field):
    """One number of its values. Its fault code is told as flags, with the code in the byte above them."""

    pole_pairs: Annotated[int | None, NOT_NULL] = Key(
        None, ge=1, description="of the motor: electrical turns in one of the wheel; required for speed"
    )

    @property
    def si_per_count(self) -> float:
        """SI units per count, of the wheel and not of the field that turns in the motor."""
        return super().si_per_count / (self.pole_pairs or 1)

    def to_si(self, number: float) -> float:
        """SI value of a number on the wire."""
        if self.name != "flags":
            return super().to_si(number / (self.pole_pairs or 1))
        code = int(number)
        flag = 0 if code == 0 else FLAG_OVER_TEMPERATURE if code in _CODES[FLAG_OVER_TEMPERATURE] else FLAG_FAULT
        return float(code << _CODE_SHIFT | flag)

    def to_wire(self, value_si: float) -> float:
        """Number on the wire, not yet rounded, of an SI value; of flags the code that they stand for."""
        if self.name != "flags":
            return super().to_wire(value_si) * (self.pole_pairs or 1)
        return next((codes[0] for flag, codes in _CODES.items() if int(value_si) & flag), 0)


class VescRegister(Register):
    """A command, or the values that a mask asks for."""

    mask: Annotated[int | None, NOT_NULL] = Key(
        None, ge=1, lt=1 << len(VALUE_BYTES), description="which values, as COMM_GET_VALUES_SELECTIVE has its bits"
    )
    fields: tuple[VescField, ...] = Key(strict=False, description="in the order of their bytes")

    @model_validator(mode="after")
    def _holds(self) -> Self:
        super()._holds()  # type: ignore[operator]
        refuse(self._mistakes())
        return self

    def _mistakes(self) -> list[Mistake]:
        if (self.access, self.id) not in _IDS:
            known = ", ".join(f"{number} ({access})" for access, number in sorted(_IDS))
            return [(("id",), f"is {self.id} ({self.access}); a VESC is asked and commanded by {known}")]
        if self.id != VALUES_ID:
            return []
        if self.mask is None:
            return [(("mask",), "is required: which values are asked for, bit by bit")]
        asked = [size for bit, sizes in enumerate(VALUE_BYTES) if self.mask >> bit & 1 for size in sizes]
        found: list[Mistake] = []
        have = [struct.calcsize(field.code) for field in self.fields]
        if asked != have:
            words = "asks for numbers of {} bytes, but the fields have {}".format(
                *(", ".join(map(str, sizes)) for sizes in (asked, have))
            )
            found.append((("mask",), f"{words}: one field for each, from the lowest bit on"))
        return found + [
            (("fields", index, "name"), "needs pole_pairs: a VESC tells the electrical speed")
            for index, field in enumerate(self.fields)
            if field.name == "speed" and field.pole_pairs is None
        ]


class VescMap(WireMap):
    """A wire map of such a wheel."""

    framing: VescFraming = VescFraming()  # type: ignore[assignment]
    ids: ClassVar[IdRanges] = IdRanges(write=(0, FIRST_READ - 1), read=(FIRST_READ, 255))  # type: ignore[misc]
    statuses: ClassVar[dict[int, str]] = STATUSES  # type: ignore[misc]
    command: VescCommand = VescCommand()
    registers: tuple[VescRegister, ...] = Key(strict=False, description="what can be read and written")

    @field_validator("registers")
    @classmethod
    def _confirming(cls, registers: tuple[VescRegister, ...]) -> tuple[VescRegister, ...]:
        refuse(
            ((index, "fields"), "need one named current, by which a command is seen to be in force: bit 5 of the mask")
            for index, register in enumerate(registers)
            if register.id == VALUES_ID and register.field("current") is None
        )
        return registers

    @property
    def mask(self) -> int:
        """Of the values that are asked for."""
        return next((register.mask for register in self.registers if register.mask is not None), 0)

    def codec(self) -> Codec:
        """For one end of a line."""
        return VescCodec(self.mask)

    def open_line(self, *line: Any) -> Line:
        """A line on which it is spoken."""
        from rw_ekf.drivers.line.vesc_link import VescLink

        settings, *more = line
        return VescLink(settings, self, *more)
