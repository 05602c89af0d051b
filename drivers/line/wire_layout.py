"""What a wire map consists of: fields, registers, framing bytes and line settings, each checked alone."""

from __future__ import annotations

import math
import struct
from functools import cached_property
from typing import Annotated, Literal, Self

from pydantic import Field as Key
from pydantic import PrivateAttr, model_validator

from rw_ekf.checking.section import NOT_NULL, Mistake, Section, matching, one_of, refuse
from rw_ekf.units import A_PER_MA, RAD_S_PER_RPM

# unit in the map -> (quantity, factor to SI). Temperatures stay in degC throughout the project.
UNITS: dict[str, tuple[str, float]] = {
    "none": ("number", 1.0),
    "rpm": ("speed", RAD_S_PER_RPM),
    "rad/s": ("speed", 1.0),
    "A": ("current", 1.0),
    "mA": ("current", A_PER_MA),
    "N m": ("current", 1.0),  # a wheel that takes a torque: it stands where a current would, motor_gain is then 1 / J
    "mN m": ("current", 1.0e-3),
    "degC": ("temperature", 1.0),
    "Pa": ("pressure", 1.0),
    "hPa": ("pressure", 100.0),
    "kPa": ("pressure", 1000.0),
    "V": ("voltage", 1.0),
    "mV": ("voltage", 1.0e-3),
    "s": ("time", 1.0),
    "ms": ("time", 1.0e-3),
    "us": ("time", 1.0e-6),
    "turn/s": ("speed", 2.0 * math.pi),
    "turn": ("angle", 2.0 * math.pi),
    "rad": ("angle", 1.0),
    "deg": ("angle", math.pi / 180.0),
}

TORQUE_UNITS = ("N m", "mN m")

# type in the map -> (struct code, lowest and highest number it carries)
TYPES: dict[str, tuple[str, float, float]] = {
    "u8": ("B", 0, 2**8 - 1),
    "i8": ("b", -(2**7), 2**7 - 1),
    "u16": ("H", 0, 2**16 - 1),
    "i16": ("h", -(2**15), 2**15 - 1),
    "u32": ("I", 0, 2**32 - 1),
    "i32": ("i", -(2**31), 2**31 - 1),
    "u64": ("Q", 0, 2**64 - 1),
    "i64": ("q", -(2**63), 2**63 - 1),
    "f32": ("f", -3.4028234663852886e38, 3.4028234663852886e38),
    "f64": ("d", -1.7976931348623157e308, 1.7976931348623157e308),
}

# Field names the program understands, and the quantity each must be given in. Other names are carried, not used.
QUANTITIES: dict[str, str] = {
    "speed": "speed",
    "speed_reference": "speed",
    "current": "current",
    "current_command": "current",
    "temperature": "temperature",
    "pressure": "pressure",
    "bus_voltage": "voltage",
    "angle": "angle",
    "uptime": "time",
    "mode": "number",
    "flags": "number",
    "type": "number",
    "version": "number",
    "serial_number": "number",
}

# By quantity, what no machine reports [SI]: the size above which a value is damage, however good its checksum. Far
# beyond what exists; speed and current below what `replay` refuses: no run leaves a log it cannot read.
BEYOND_ANY_MACHINE: dict[str, float] = {
    "speed": 2.0e5,  # 1.9 million rpm; the fastest rotors on bearings reach a million, limits.speed_rpm allows as much
    "current": 1.0e4,  # limits.current_A allows a tenth
    "temperature": 1.0e4,  # hotter than any solid; an open sensor on a scaled integer (-327.68 degC) stays below
    "pressure": 1.0e9,
    "voltage": 1.0e6,
    "time": 1.0e10,  # three hundred years
    "angle": 1.0e13,  # at the highest speed, a year and a half
    "number": 2.0**53,  # beyond it a double has no whole numbers
}

Name = Annotated[str, matching(r"[a-z][a-z0-9_]*", "write a name in small letters, digits and _")]
Byte = Annotated[int, Key(ge=0, le=255)]
IdRange = tuple[Byte, Byte]
Crc = Literal["crc16-mcrf4xx", "crc16-x25", "crc16-kermit", "crc16-modbus"]  # see framing.CRCS


class Field(Section):
    """One number in a register: value in `unit` = number on the wire * scale + offset."""

    name: Name = Key(description="what it is")
    type: Annotated[str, one_of(TYPES)] = Key(description="how the number is carried")
    unit: Annotated[str, one_of(UNITS)] = "none"
    scale: float = Key(1.0, description="unit per count")
    offset: float = Key(0.0, description="value at count 0, in the unit")
    constant: Annotated[float | None, NOT_NULL] = None  # always sent as it stands (and must be, to be accepted)

    @model_validator(mode="after")
    def _holds(self) -> Self:
        mistakes: list[Mistake] = []
        wanted = QUANTITIES.get(self.name, self.quantity)
        if self.scale == 0.0:
            mistakes.append((("scale",), "must not be 0: the value could not be written"))
        if self.quantity != wanted:
            units = ", ".join(unit for unit, (quantity, _) in UNITS.items() if quantity == wanted)
            at = "unit" if "unit" in self.model_fields_set else "name"
            mistakes.append(((at,), f"does not fit, {self.name} in {self.unit}; its unit must be one of {units}"))
        if self.constant is not None and not self.numbers[0] <= self.constant <= self.numbers[1]:
            mistakes.append((("constant",), f"must fit into {self.type}, found {self.constant:g}"))
        refuse(mistakes)
        return self

    @cached_property
    def numbers(self) -> tuple[float, float]:
        """The lowest and the highest number on the wire."""
        return TYPES[self.type][1:]

    def carry_only(self, low: float, high: float) -> None:
        """Let these be its lowest and its highest number, where it has fewer bits than its type."""
        vars(self).update(numbers=(low, high))

    @property
    def is_float(self) -> bool:
        """Whether it is carried as a floating-point number."""
        return self.type in ("f32", "f64")

    @property
    def is_signed(self) -> bool:
        """Whether it is a whole number below zero too."""
        return self.type in ("i8", "i16", "i32", "i64")

    @property
    def quantity(self) -> str:
        """What the unit measures: "speed", "current", ..."""
        return UNITS[self.unit][0]

    @property
    def si_per_count(self) -> float:
        """SI units per count on the wire: the resolution of the field."""
        return abs(self.scale) * UNITS[self.unit][1]

    @property
    def code(self) -> str:
        """How `struct` packs the number."""
        return TYPES[self.type][0]

    @property
    def si_range(self) -> tuple[float, float]:
        """The lowest and the highest value that the field can carry [SI]."""
        low, high = self.numbers
        ends = (self.to_si(low), self.to_si(high))
        return min(ends), max(ends)

    @property
    def si_span(self) -> float:
        """After how much an integer counter wraps [SI], e.g. 2**32 ms in seconds."""
        low, high = self.numbers
        return (high - low + 1.0) * self.si_per_count

    def rounded(self, number: float) -> float:
        """The nearest number that the field carries."""
        return number if self.is_float else round(number)

    def saturated(self, number: float) -> float:
        """What a wheel sends of a number: its range's end, the lowest for NaN; an uptime wraps; a float is as it is."""
        low, high = self.numbers
        if not math.isfinite(number):
            return number if self.is_float else high if number > 0.0 else low
        if self.name == "uptime" and not self.is_float:
            number = low + (round(number) - low) % round(high - low + 1)
        return self.rounded(min(max(number, low), high))

    def is_possible(self, value_si: float) -> bool:
        """Whether a wheel means it: a speed at the very end of a signed integer is saturated, or about to go round."""
        return not (self.name == "speed" and self.is_signed and value_si in self.si_range)

    def most_change_si(self, within_s: float) -> float:
        """What a reading can change by in a time [s] of no more than a second: half of what its integer carries."""
        return math.inf if self.is_float else 0.5 * self.si_span

    @property
    def is_believed_twice(self) -> bool:
        """Whether a reading that changed by more is true where the next one agrees with it."""
        return False

    def to_si(self, number: float) -> float:
        """SI value of a number on the wire, to the digits that a count has: 0.1013 A, not 0.10130000000000002."""
        return float(f"{(number * self.scale + self.offset) * UNITS[self.unit][1]:.15g}")

    def to_wire(self, value_si: float) -> float:
        """Number on the wire, not yet rounded, of an SI value."""
        return (value_si / UNITS[self.unit][1] - self.offset) / self.scale


class Register(Section):
    """One register: an id, a direction and its fields in the order of their bytes."""

    id: Byte = Key(description="what requests call it")
    name: Name = Key(description="what it is")
    access: Literal["read", "write"] = Key(description="what a request of that id does")
    fields: tuple[Field, ...] = Key(strict=False, description="in the order of their bytes")
    _order: str = PrivateAttr("<")  # of the bytes, as `struct` has it; a map sets it from its framing

    @model_validator(mode="after")
    def _holds(self) -> Self:
        names = [field.name for field in self.fields]
        if not names:
            refuse([(("fields",), "must be a list with at least one field")])
        refuse(
            (("fields", index, "name"), f"is taken: field {name} stands twice in this register")
            for index, name in enumerate(names)
            if name in names[:index]
        )
        return self

    def __copy__(self) -> Self:
        copied = super().__copy__()
        for name in ("packing", "_by_name"):  # `model_copy` may give it other fields
            vars(copied).pop(name, None)
        return copied

    @cached_property
    def packing(self) -> struct.Struct:
        """The bytes of the register's data."""
        return struct.Struct(self._order + "".join(field.code for field in self.fields))

    @property
    def size(self) -> int:
        """Number of data bytes."""
        return self.packing.size

    def field(self, name: str) -> Field | None:
        """The field of that name, or None."""
        return self._by_name.get(name)

    @cached_property
    def _by_name(self) -> dict[str, Field]:
        return {field.name: field for field in self.fields}


class Framing(Section):
    """How a body becomes a frame: escape start body escape end, the body's escapes doubled, a CRC at its end."""

    escape: Byte = 0x1F
    start: Byte = 0x7F
    end: Byte = 0xFF
    crc: Crc = "crc16-mcrf4xx"
    byte_order: Literal["little", "big"] = Key("little", description="of the values in the data")
    address: Byte | None = Key(
        None, description="of the wheel: a byte before seq, in requests and replies; null: there is none"
    )

    @model_validator(mode="after")
    def _holds(self) -> Self:
        if len({self.escape, self.start, self.end}) < 3:
            refuse([((), "needs three different bytes for escape, start and end")])
        return self


class LineSettings(Section):
    """The serial line as the wheel expects it."""

    baud: int = Key(38400, ge=50, le=4_000_000, description="line speed [baud]")
    data_bits: int = Key(8, ge=8, le=8, description="per byte")
    parity: Literal["none", "even", "odd"] = "none"
    stop_bits: int = Key(1, ge=1, le=2, description="after a byte")
    reply_timeout_ms: float = Key(40.0, ge=1, le=60_000, description="how long a reply is waited for [ms]")

    @property
    def reply_timeout_s(self) -> float:
        """How long a reply is waited for [s]."""
        return self.reply_timeout_ms / 1000.0

    @property
    def bits_per_byte(self) -> int:
        """Bits on the line for one byte: start, data, parity and stop."""
        return 1 + self.data_bits + (self.parity != "none") + self.stop_bits


class IdRanges(Section):
    """Which ids write and which read, both ends included."""

    write: IdRange = Key((0, 127), strict=False, description="[first, last] of the ids that write")
    read: IdRange = Key((128, 255), strict=False, description="[first, last] of the ids that read")

    @model_validator(mode="after")
    def _holds(self) -> Self:
        ranges = {"write": self.write, "read": self.read}
        mistakes: list[Mistake] = [
            ((name,), f"goes from {first} to {last}: the first id must not be above the last")
            for name, (first, last) in ranges.items()
            if first > last
        ]
        if max(self.write[0], self.read[0]) <= min(self.write[1], self.read[1]):
            found = f"write {list(self.write)} and read {list(self.read)}"
            mistakes.append(((), f"overlap, {found}: an id either writes or reads"))
        refuse(mistakes)
        return self
