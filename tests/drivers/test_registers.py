"""Register data: SI in, bytes out and back."""

from __future__ import annotations

import math

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rw_ekf.drivers.line.registers import decode_register, encode_register, encode_saturated, rounded_si
from rw_ekf.drivers.line.wire_layout import Field, Register
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.units import rad_s_from_rpm


def test_golden_cycle_data(wire_map: WireMap) -> None:
    """The sixteen bytes of a cycle reply mean these values."""
    cycle = wire_map.register("cycle")
    assert cycle is not None
    data = bytes.fromhex("d007 18fc e803 9a09 0a00 606d 40e20100")
    assert decode_register(cycle, data) == pytest.approx(
        {
            "speed": rad_s_from_rpm(1000.0), "current": -0.1, "current_command": 0.1, "temperature": 24.58,
            "pressure": 100.0, "bus_voltage": 28.0, "uptime": 123.456,
        }
    )  # fmt: skip
    assert encode_register(cycle, decode_register(cycle, data)) == data


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(current_A=st.floats(-3.2768, 3.2767))
def test_a_current_survives_to_half_a_count(wire_map: WireMap, current_A: float) -> None:
    """Rounding is to the nearest count: what arrives is within half of 0.1 mA, and rounded_si foretells it."""
    register = wire_map.current_command
    arrived = decode_register(register, encode_register(register, {"current_command": current_A}))["current_command"]
    assert abs(arrived - current_A) <= 0.5e-4 + 1e-12
    assert arrived == rounded_si(register.fields[0], current_A)


@pytest.mark.parametrize("current_A", [3.2768, -3.29, math.nan, math.inf])
def test_what_the_wire_cannot_carry_is_refused(wire_map: WireMap, current_A: float) -> None:
    """A current out of range, or none at all, is an error that names the field; it is never clipped."""
    with pytest.raises(ValueError, match="current_command"):
        encode_register(wire_map.current_command, {"current_command": current_A})


def test_wrong_length_and_missing_values_are_named(wire_map: WireMap) -> None:
    """Data of another length, or a value left out, is an error that says which."""
    with pytest.raises(ValueError, match="has 2 data bytes, not 3"):
        decode_register(wire_map.current_command, b"abc")
    with pytest.raises(ValueError, match="needs a value for current_command"):
        encode_register(wire_map.current_command, {})


def test_constants_need_no_value(wire_map: WireMap) -> None:
    """The reset key is in the map, so nobody need know it."""
    reset = wire_map.register("reset")
    assert reset is not None
    assert encode_register(reset, {}) == b"\x55"


def test_every_type_and_byte_order_round_trips() -> None:
    """All seven types, both byte orders, with scale and offset."""
    types = ("u8", "i8", "u16", "i16", "u32", "i32", "f32")
    fields = tuple(Field(name=f"v{i}", type=kind, unit="mV", scale=0.5, offset=3.0) for i, kind in enumerate(types))
    values = {f"v{i}": (40.0 * 0.5 + 3.0) * 1e-3 for i in range(len(types))}
    for order in ("<", ">"):
        register = Register(id=200, name="all", access="read", fields=fields)
        register._order = order
        data = encode_register(register, values)
        assert decode_register(register, data) == pytest.approx(values)
    assert data[:4] == bytes((40, 40, 0, 40))


def test_telemetry_saturates_and_its_uptime_wraps(wire_map: WireMap) -> None:
    """A wheel too fast for its register reports the end of the range; its uptime wraps after 2^32 ms."""
    cycle = wire_map.register("cycle")
    assert cycle is not None
    values = decode_register(cycle, encode_saturated(cycle, {"speed": 1e6, "uptime": 2**32 / 1000 + 1.5}))
    assert values["speed"] == pytest.approx(rad_s_from_rpm(16383.5))
    assert values["uptime"] == pytest.approx(1.5)
