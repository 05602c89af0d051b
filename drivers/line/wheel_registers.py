"""Which of a wire map's registers a sample is made of, and what the wheel's status flags mean."""

from __future__ import annotations

from rw_ekf.drivers.line.wire_layout import Field, Register
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
    """The register of a sample that has the command in force; None where the wheel does not tell it."""
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
