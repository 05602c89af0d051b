"""The wire map: what the project's map says, and one clear finding for everything that can be wrong with one."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import pytest

from rw_ekf.checking.findings import Where
from rw_ekf.drivers.line.wire_map import WireMap, wire_map_from_mapping
from rw_ekf.errors import ConfigError
from rw_ekf.units import rpm_from_rad_s

Data = dict[str, Any]


def test_the_project_s_map_is_the_contract_s_table(wire_map: WireMap) -> None:
    """Ids, sizes, line and framing are those of the protocol's table."""
    assert {r.id: (r.name, r.size) for r in wire_map.registers} == {
        1: ("reset", 1), 2: ("speed_reference", 2), 3: ("current_command", 2), 10: ("mode", 1), 128: ("identity", 8),
        130: ("status", 2), 133: ("speed", 2), 135: ("current", 2), 137: ("cycle", 16),
    }  # fmt: skip
    assert (wire_map.link.baud, wire_map.link.bits_per_byte, wire_map.link.reply_timeout_s) == (38400, 10, 0.040)
    assert (wire_map.framing.escape, wire_map.framing.start, wire_map.framing.end) == (0x1F, 0x7F, 0xFF)
    assert wire_map.speed_register.name == "cycle"


def test_the_map_knows_what_it_can_carry(wire_map: WireMap) -> None:
    """Limits can be compared with the range of a field in SI units."""
    assert wire_map.current_range_A == pytest.approx((-3.2768, 3.2767))
    assert rpm_from_rad_s(wire_map.speed_range_rad_s[1]) == pytest.approx(16383.5)


def register(data: Data, name: str) -> Data:
    """The register of that name in a map's data."""
    found: Data = next(entry for entry in data["registers"] if entry["name"] == name)
    return found


def field(data: Data, name: str, index: int = 0) -> Data:
    """A field of that register."""
    found: Data = register(data, name)["fields"][index]
    return found


SPOILT: dict[str, tuple[Callable[[Data], object], str]] = {
    "no speed": (
        lambda d: d.update(registers=[r for r in d["registers"] if r["name"] not in {"speed", "cycle"}]),
        "map.yaml:registers: registers need one with access read and a field named speed",
    ),
    "no current command": (
        lambda d: d["registers"].remove(register(d, "current_command")),
        "map.yaml:registers: registers need one named current_command with access write",
    ),
    "odd current command": (
        lambda d: field(d, "current_command").update(name="amps", unit="none"),
        "current_command must have exactly one field",
    ),
    "same id": (
        lambda d: register(d, "speed").update(id=135),
        "registers.7.id 135 is already used by",
    ),
    "same name": (lambda d: register(d, "current").update(name="speed"), "registers.7.name speed is already used"),
    "type": (
        lambda d: field(d, "speed").update(type="i24"),
        "0.type must be one of u8, i8, u16, i16, u32, i32, u64, i64, f32, f64; found the text 'i24'; did you mean",
    ),
    "unit": (lambda d: field(d, "speed").update(unit="RPM"), "0.unit must be one of none, rpm, rad/s"),
    "quantity": (lambda d: field(d, "speed").update(unit="mA"), "speed in mA; its unit must be one of rpm, rad/s"),
    "no unit": (lambda d: field(d, "speed").pop("unit"), "speed in none; its unit must be one of rpm"),
    "access": (
        lambda d: register(d, "speed").update(access="rw"),
        "6.access must be one of read, write; found",
    ),
    "id against access": (
        lambda d: register(d, "speed").update(id=20),
        "has access read; ids that read are 128 to",
    ),
    "unknown key": (lambda d: d.update(bauds=1), "map.yaml:bauds: unknown key bauds; known here: name, framing"),
    "unknown field key": (
        lambda d: field(d, "speed").update(factor=2),
        "0.factor; known here: name, type",
    ),
    "missing key": (
        lambda d: register(d, "mode").pop("fields"),
        "map.yaml:registers.3.fields: registers.3.fields is required",
    ),
    "zero scale": (lambda d: field(d, "speed").update(scale=0), "scale must not be 0"),
    "text scale": (lambda d: field(d, "speed").update(scale="1e-5"), "scale must be a number, found the text '1e-5'"),
    "nan scale": (lambda d: field(d, "speed").update(scale=float("nan")), "scale must be a finite number, found nan"),
    "constant": (lambda d: field(d, "reset").update(constant=300), "constant must fit into u8, found 300"),
    "field twice": (lambda d: field(d, "cycle", 1).update(name="speed", unit="rpm"), "field speed stands twice"),
    "markers": (lambda d: d["framing"].update(start=0x1F), "framing needs three different bytes"),
    "crc": (lambda d: d["framing"].update(crc="crc32"), "framing.crc must be one of crc16-mcrf4xx"),
    "baud": (lambda d: d["link"].update(baud="fast"), "link.baud must be a whole number, found the text 'fast'"),
    "boolean baud": (lambda d: d["link"].update(baud=True), "link.baud must be a whole number, found true"),
    "overlap": (lambda d: d["ids"].update(write=[0, 200]), "ids overlap, write [0, 200] and read [128, 255]"),
    "range": (lambda d: d["ids"].update(read=[128]), "ids.read.1 is required: [first, last] of the ids that read"),
    "status": (lambda d: d["statuses"].update({0: "fine"}), "statuses must name 0 ok"),
    "registers": (lambda d: d.update(registers={}), "registers must be a list, found a table of keys"),
    "fields": (
        lambda d: register(d, "mode").update(fields=[]),
        "3.fields must be a list with at least one field",
    ),
    "none": (lambda d: d.clear(), "registers is required"),
}


@pytest.mark.parametrize("case", SPOILT)
def test_a_spoilt_map_says_what_is_wrong(case: str, map_data: Data, where: Where) -> None:
    """Each mistake gives a ConfigError that names the place and what to write instead."""
    spoil, message = SPOILT[case]
    spoil(map_data)
    with pytest.raises(ConfigError) as raised:
        wire_map_from_mapping(map_data, where)
    assert message in str(raised.value)
    assert all(finding.startswith("map.yaml:") for finding in raised.value.findings)


def test_all_findings_come_at_once(map_data: Data, where: Where) -> None:
    """Three mistakes give three findings, not the first one three times over."""
    field(map_data, "speed").update(unit="RPM")
    field(map_data, "current").update(type="i24")
    map_data["link"]["baud"] = -1
    with pytest.raises(ConfigError) as raised:
        wire_map_from_mapping(map_data, where)
    assert len(raised.value.findings) == 3


def test_only_speed_and_current_command_are_needed(map_data: Data, where: Where) -> None:
    """A map with two registers and nothing else is a map, on the default line."""
    small = {"registers": [copy.deepcopy(register(map_data, name)) for name in ("current_command", "speed")]}
    wire_map = wire_map_from_mapping(small, where)
    assert wire_map.speed_register.name == "speed"
    assert wire_map.link.baud == 38400
    assert wire_map.status_name(3) == "out_of_range"
