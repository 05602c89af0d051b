"""Register data by the wire map: SI values in and out, which registers a sample is made of, what status flags mean."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping

from rw_ekf.drivers.line.wire_layout import BEYOND_ANY_MACHINE, QUANTITIES, Field, Register
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.records import CURRENT_LIMITED, FAULT, OVER_TEMPERATURE

FLAGS = {1: FAULT, 2: CURRENT_LIMITED, 4: OVER_TEMPERATURE}
FLAG_RESET = 8  # reset since last read
COARSEST_S = 0.05  # a clock that counts in larger steps gives no time to a sample
MODES_OF_CURRENT = (0.0, 1.0)  # idle, where nothing has been written yet or was let go; current
COLDEST_DEGC = -150.0  # a number below is a broken thermistor's, or a field at its end
NO_CONDITIONS: frozenset[str] = frozenset()
TELEMETRY = (
    "speed",
    "current",
    "current_command",
    "temperature",
    "pressure",
    "bus_voltage",
    "angle",
    "uptime",
    "flags",
)


def decode_register(register: Register, data: bytes) -> dict[str, float]:
    """SI values by field name. Raises ValueError if `data` has another length than the map says."""
    packing = register.packing
    if len(data) != packing.size:
        raise ValueError(f"register {register.name} has {packing.size} data bytes, not {len(data)}")
    numbers = packing.unpack(data)
    return {field.name: field.to_si(number) for field, number in zip(register.fields, numbers, strict=True)}


def is_plausible(register: Register, values_si: Mapping[str, float]) -> bool:
    """Whether every value that the program uses is finite and such as a machine can have, and this field.

    A float register carries infinity, NaN and 3e38 as readily as a speed, and the checksum is right. Fields of names
    that the program does not use may hold what they like.
    """
    return all(
        abs(values_si[field.name]) <= BEYOND_ANY_MACHINE.get(QUANTITIES[field.name], math.inf)
        and math.isfinite(values_si[field.name])
        and field.is_possible(values_si[field.name])
        for field in register.fields
        if field.name in QUANTITIES
    )


def encode_register(register: Register, values_si: Mapping[str, float]) -> bytes:
    """Data bytes of SI values, each rounded to the nearest count; constants of the map need not be given.

    Raises ValueError naming the field where a value is missing, not finite or beyond what its type can carry.
    """
    return register.packing.pack(*(_number(register, field, values_si) for field in register.fields))


def encode_saturated(register: Register, values_si: Mapping[str, float]) -> bytes:
    """As a wheel's telemetry: values beyond the type's range sit at its end, the uptime wraps, unknown fields are 0.

    A float carries NaN and infinity as they are; an integer has its lowest number for NaN.
    """
    numbers = (
        field.to_wire(values_si.get(field.name, 0.0)) if field.constant is None else field.constant
        for field in register.fields
    )
    return register.packing.pack(*(field.saturated(n) for field, n in zip(register.fields, numbers, strict=True)))


def rounded_si(field: Field, value_si: float) -> float:
    """The SI value that arrives when `value_si` is sent through `field`."""
    number = field.rounded(field.to_wire(value_si))
    if field.type == "f32":
        (number,) = struct.unpack("<f", struct.pack("<f", number))
    return field.to_si(number)


def _number(register: Register, field: Field, values_si: Mapping[str, float]) -> float:
    """The number on the wire of one field, checked."""
    if field.constant is not None:
        return field.rounded(field.constant)
    if field.name not in values_si:
        raise ValueError(f"register {register.name} needs a value for {field.name}")
    value_si = values_si[field.name]
    if not math.isfinite(value_si):
        raise ValueError(f"register {register.name}: {field.name} must be finite, not {value_si}")
    number = field.rounded(field.to_wire(value_si))
    low, high = field.numbers
    if not low <= number <= high:
        least, most = field.si_range
        raise ValueError(
            f"register {register.name}: {field.name} {value_si:g} is beyond what {field.type} carries "
            f"({least:g} to {most:g} in SI units)"
        )
    return number


def registers_beside(main: Register, wire_map: WireMap) -> tuple[Register, ...]:
    """Where the speed's register lacks a value, those named after it, or it and _read, that carry it."""
    known = {field.name for field in main.fields}
    found = []
    for register in wire_map.readable():
        value = register.name.removesuffix("_read")
        if register is not main and value in TELEMETRY and value not in known and register.field(value):
            found.append(register)
    return tuple(found)


def telling_register(wire_map: WireMap) -> Register | None:
    """The register of a sample that has the command in force; None where the wheel does not report it."""
    main = wire_map.speed_register
    return next((r for r in (main, *registers_beside(main, wire_map)) if r.field("current_command")), None)


def uptime_field(registers: tuple[Register, ...]) -> Field | None:
    """The field that gives a sample its time; None where the wheel has no clock, or one too coarse for that."""
    for register in registers:
        field = register.field("uptime")
        if field is not None:
            return field if field.is_float or field.si_per_count <= COARSEST_S else None
    return None


def conditions(flags: float | None) -> frozenset[str]:
    """What the wheel's status flags mean."""
    return NO_CONDITIONS if not flags else frozenset(name for bit, name in FLAGS.items() if int(flags) & bit)


def possible_temperature(value_degC: float | None) -> float | None:
    """A temperature [degC] where a bearing can have it; a hotter one is kept as hot, for it must stop the wheel."""
    return None if value_degC is None or value_degC < COLDEST_DEGC else value_degC
