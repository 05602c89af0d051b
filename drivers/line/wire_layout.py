"""What a wire map consists of: fields, registers, framing bytes and line settings. Values only; see wire_map.py."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

from rw_ekf.units import A_PER_MA, RAD_S_PER_RPM

# unit in the map -> (quantity, factor to SI). Temperatures stay in degC throughout the project.
UNITS: dict[str, tuple[str, float]] = {
    "none": ("number", 1.0),
    "rpm": ("speed", RAD_S_PER_RPM),
    "rad/s": ("speed", 1.0),
    "A": ("current", 1.0),
    "mA": ("current", A_PER_MA),
    "degC": ("temperature", 1.0),
    "Pa": ("pressure", 1.0),
    "hPa": ("pressure", 100.0),
    "kPa": ("pressure", 1000.0),
    "V": ("voltage", 1.0),
    "mV": ("voltage", 1.0e-3),
    "s": ("time", 1.0),
    "ms": ("time", 1.0e-3),
    "us": ("time", 1.0e-6),
    "rad": ("angle", 1.0),
    "deg": ("angle", math.pi / 180.0),
}

# type in the map -> (struct code, lowest and highest number it carries)
TYPES: dict[str, tuple[str, float, float]] = {
    "u8": ("B", 0, 2**8 - 1),
    "i8": ("b", -(2**7), 2**7 - 1),
    "u16": ("H", 0, 2**16 - 1),
    "i16": ("h", -(2**15), 2**15 - 1),
    "u32": ("I", 0, 2**32 - 1),
    "i32": ("i", -(2**31), 2**31 - 1),
    "f32": ("f", -3.4028234663852886e38, 3.4028234663852886e38),
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


@dataclass(frozen=True, slots=True)
class Field:
    """One number in a register: value in `unit` = number on the wire * scale + offset."""

    name: str
    type: str
    unit: str = "none"
    scale: float = 1.0
    offset: float = 0.0
    constant: float | None = None  # a key that is always sent as it stands (and must be, to be accepted)

    @property
    def quantity(self) -> str:
        """What the unit measures: "speed", "current", ..."""
        return UNITS[self.unit][0]

    @property
    def si_per_count(self) -> float:
        """SI units per count on the wire: the resolution of the field."""
        return abs(self.scale) * UNITS[self.unit][1]

    @property
    def si_range(self) -> tuple[float, float]:
        """The lowest and the highest value that the field can carry [SI]."""
        _, low, high = TYPES[self.type]
        ends = (self.to_si(low), self.to_si(high))
        return min(ends), max(ends)

    @property
    def si_span(self) -> float:
        """After how much an integer counter wraps [SI], e.g. 2**32 ms in seconds."""
        _, low, high = TYPES[self.type]
        return (high - low + 1.0) * self.si_per_count

    def to_si(self, number: float) -> float:
        """SI value of a number on the wire, to the digits that a count has: 0.1013 A, not 0.10130000000000002."""
        return float(f"{(number * self.scale + self.offset) * UNITS[self.unit][1]:.15g}")

    def to_wire(self, value_si: float) -> float:
        """Number on the wire, not yet rounded, of an SI value."""
        return (value_si / UNITS[self.unit][1] - self.offset) / self.scale


@dataclass(frozen=True, slots=True)
class Register:
    """One register: an id, a direction and its fields in the order of their bytes."""

    id: int
    name: str
    access: str  # "read" or "write"
    fields: tuple[Field, ...]
    byte_order: str = "little"

    @property
    def packing(self) -> struct.Struct:
        """The bytes of the register's data."""
        order = "<" if self.byte_order == "little" else ">"
        return struct.Struct(order + "".join(TYPES[field.type][0] for field in self.fields))

    @property
    def size(self) -> int:
        """Number of data bytes."""
        return self.packing.size

    def field(self, name: str) -> Field | None:
        """The field of that name, or None."""
        return next((field for field in self.fields if field.name == name), None)


@dataclass(frozen=True, slots=True)
class Framing:
    """How a body becomes a frame: escape start body escape end, the body's escapes doubled, a CRC at its end."""

    escape: int = 0x1F
    start: int = 0x7F
    end: int = 0xFF
    crc: str = "crc16-mcrf4xx"


@dataclass(frozen=True, slots=True)
class LineSettings:
    """The serial line as the wheel expects it."""

    baud: int = 38400
    data_bits: int = 8
    parity: str = "none"
    stop_bits: int = 1
    reply_timeout_s: float = 0.040

    @property
    def bits_per_byte(self) -> int:
        """Bits on the line for one byte: start, data, parity and stop."""
        return 1 + self.data_bits + (self.parity != "none") + self.stop_bits
