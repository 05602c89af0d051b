"""Register data by the wire map: SI values in and out, pure functions."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping

from rw_ekf.drivers.line.wire_layout import BEYOND_ANY_MACHINE, QUANTITIES, Field, Register


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
