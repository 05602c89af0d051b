"""A wire map as XTCE and COSMOS: the schema holds, and who reads them decodes a wheel's frames to the same numbers."""

from __future__ import annotations

import re
import shlex
import struct
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.attach.wire import load_protocol
from rw_ekf.cli import main
from rw_ekf.driver import DescribedProtocol
from rw_ekf.drivers.line.framing import Frame, crc16, decode, encode
from rw_ekf.drivers.line.nsp import unpacked
from rw_ekf.drivers.line.registers import decode_register, encode_register
from rw_ekf.drivers.line.wire_layout import UNITS
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.drivers.protocols import FAMILIES as PLACES
from rw_ekf.settings.resources import config_resource
from tests.contract import check_document
from tests.live.bench import FAMILIES, served_wheel, wire_map_of

OWN_MAP = """
name: big
framing: {byte_order: big, crc: crc16-x25}
registers:
  - id: 1
    name: current_command
    access: write
    fields: [{name: current_command, type: i32, scale: -0.001, offset: 2.0, unit: A}]
  - id: 2
    name: limits
    access: write
    fields: [{name: key, type: u16, constant: 4660}, {name: most, type: f32, unit: rpm}]
  - id: 200
    name: speed
    access: read
    fields:
      - {name: speed, type: f32, unit: rad/s}
      - {name: temperature, type: i8, scale: 0.5, offset: 20, unit: degC}
      - {name: word, type: u32}
"""


@pytest.fixture(params=["sunspace-wheel", "own"])
def wire_map(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[str, WireMap]:
    """A map by its name, shipped and of one's own: big endian, floats, offsets, another checksum."""
    name = request.param
    if name == "own":
        name = str(tmp_path / "own.yaml")
        Path(name).write_text(OWN_MAP)
    return name, wire_map_of(name)


def exported(name: str, out: Path) -> str:
    assert main(["export", name, str(out)]) == 0
    return out.read_text()


def bodies(wire_map: WireMap) -> dict[str, bytes]:
    """A reply of each register: of a wheel that turns, where there is one to ask; each an escape in it."""
    found = {}
    for number, register in enumerate(wire_map.registers, start=30):
        data = b"\x00"
        if register.access == "read":
            values = {field.name: field.to_si(41 + number + 17 * index) for index, field in enumerate(register.fields)}
            data = encode_register(register, values)
        content = bytes((number, register.id)) + data
        suffix = "" if register.access == "read" else "_status"
        found[register.name + suffix] = content + crc16(content, wire_map.framing.crc).to_bytes(2, "little")
        (frame,) = decode(encode(number, register.id, data, wire_map.framing), wire_map.framing).frames
        assert frame == Frame(number, register.id, data)  # it is what the line carries
    return found


def in_units_of_the_map(wire_map: WireMap, name: str, body: bytes) -> dict[str, float]:
    """What the driver decodes."""
    register = wire_map.register(name)
    assert register is not None
    values = decode_register(register, body[2:-2])
    return {field.name: values[field.name] / UNITS[field.unit][1] for field in register.fields}


def test_the_document_holds_against_the_schema_of_xtce(wire_map: tuple[str, WireMap], tmp_path: Path) -> None:
    """XTCE 1.2's own schema, as the Object Management Group has published it."""
    validation = pytest.importorskip("space_packet_parser.xtce.validation")
    exported(wire_map[0], tmp_path / "wheel.xml")
    result = validation.validate_xtce(tmp_path / "wheel.xml", print_results=False, allow_schema_download=False)
    assert result.valid, result.errors


def test_who_reads_the_xtce_decodes_a_wheel_s_replies(wire_map: tuple[str, WireMap], tmp_path: Path) -> None:
    """A decoder of telemetry that knows nothing of this program gives every register's numbers, units calibrated."""
    definitions = pytest.importorskip("space_packet_parser.xtce.definitions")
    exported(wire_map[0], tmp_path / "wheel.xml")
    definition = definitions.XtcePacketDefinition.from_xtce(tmp_path / "wheel.xml", root_container_name="Reply")
    found = bodies(wire_map[1])
    for name, body in found.items():
        packet = definition.parse_bytes(body, root_container_name="Reply")
        assert (packet["seq"], packet["id"]) == (body[0], body[1])
        assert packet["crc"].raw_value == int.from_bytes(body[-2:], "little")
        if name.endswith("_status"):
            assert packet[f"{name}_status"] == "ok"
            continue
        for field, value in in_units_of_the_map(wire_map[1], name, body).items():
            assert float(packet[f"{name}_{field}"]) == pytest.approx(value, rel=1e-12), (name, field)


def test_replies_of_a_wheel_with_an_address_are_told_apart_by_their_register(tmp_path: Path) -> None:
    """The address is a constant of every packet: by it alone the reply to a write was taken for telemetry."""
    definitions = pytest.importorskip("space_packet_parser.xtce.definitions")
    own = tmp_path / "own.yaml"
    own.write_text(OWN_MAP.replace("framing: {", "framing: {address: 7, "))
    exported(str(own), tmp_path / "wheel.xml")
    definition = definitions.XtcePacketDefinition.from_xtce(tmp_path / "wheel.xml", root_container_name="Reply")
    register = wire_map_of(str(own)).register("speed")
    assert register is not None
    data = encode_register(register, {"speed": 100.0, "temperature": 25.0, "word": 4.0})
    for content, name, reported in (
        (bytes((7, 30, 200)) + data, "speed_speed", 100.0), (bytes((7, 30, 2, 0)), "limits_status_status", "ok")
    ):  # fmt: skip
        body = content + crc16(content, "crc16-x25").to_bytes(2, "little")
        assert definition.parse_bytes(body, root_container_name="Reply")[name] == reported


@pytest.mark.parametrize("name", ["nsp-wheel", "nsp-wheel-torque", "nsp-wheel-large"])
def test_replies_of_an_nsp_wheel_are_decoded_and_its_commands_are_the_driver_s(name: str, tmp_path: Path) -> None:
    """Each file's reply, as the codec of the wheel sends it, by XTCE; fixed bytes of commands are those of requests."""
    definitions = pytest.importorskip("space_packet_parser.xtce.definitions")
    validation = pytest.importorskip("space_packet_parser.xtce.validation")
    text = exported(name, tmp_path / "wheel.xml")
    assert validation.validate_xtce(tmp_path / "wheel.xml", print_results=False, allow_schema_download=False).valid
    definition = definitions.XtcePacketDefinition.from_xtce(tmp_path / "wheel.xml", root_container_name="Reply")
    wire_map = wire_map_of(name)
    for register in wire_map.registers:
        codec = wire_map.codec()
        (packet,), _, _ = unpacked(codec.request(0, register.id, bytes(register.size) * (register.access == "write")))
        if register.name == "identity":
            continue
        command = register.name if register.access == "write" else f"read_{register.name}"
        fixed = re.findall(r'binaryValue="(..)"', text.split(f'"{command}_packet"')[1].split("</MetaCommand>")[0])
        assert bytes.fromhex("".join(fixed)) == bytes(packet[:3]) + packet.data[: len(fixed) - 3]
        if register.access == "read":
            data = encode_register(register, {field.name: 1.5 + i for i, field in enumerate(register.fields)})
            (reply,), _, _ = unpacked(codec.reply(Frame(1, register.id, data)))
            body = bytes(reply[:3]) + reply.data
            body += crc16(body).to_bytes(2, "little")
            read = definition.parse_bytes(body, root_container_name="Reply")
            values = decode_register(register, data)
            for field in register.fields:
                reported = values[field.name] / UNITS[field.unit][1]
                assert float(read[f"{register.name}_{field.name}"]) == pytest.approx(reported)


def test_the_document_has_units_ranges_and_every_command(wire_map: tuple[str, WireMap], tmp_path: Path) -> None:
    """Arguments have the ends that the driver accepts, constants their bytes, the checksum its polynomial."""
    from xml.etree import ElementTree

    text = re.sub(r' xmlns="[^"]*"', "", exported(wire_map[0], tmp_path / "wheel.xml"))
    root = ElementTree.fromstring(text)
    commands = {command.attrib["name"]: command for command in root.iter("MetaCommand")}
    for register in wire_map[1].registers:
        if register.access == "read":
            assert f"read_{register.name}" in commands
            continue
        command = commands[register.name]
        fixed = [entry.attrib["binaryValue"] for entry in command.iter("FixedValueEntry")]
        assert int(fixed[0], 16) == register.id
        for field in register.fields:
            if field.constant is not None:
                assert (
                    int(fixed[1], 16) == field.constant
                )  # its byte order is that of the data: "own" has the big end first
                continue
            kind = next(e for e in root.iter() if e.get("name") == f"{register.name}_{field.name}_type")
            ends = next(kind.iter("ValidRange")).attrib
            factor = UNITS[field.unit][1]
            found = tuple(float(ends[key]) * factor for key in ("minInclusive", "maxInclusive"))
            assert found == pytest.approx(field.si_range)
            assert [unit.text for unit in kind.iter("Unit")] == ([] if field.unit == "none" else [field.unit])
    assert {element.text for element in root.iter("Polynomial")} == {"1021"}  # of all four, CRC-16/CCITT's


def cosmos_packets(text: str) -> dict[str, list[dict[str, Any]]]:
    """Packets of a file of COSMOS, items with their modifiers, read by the rules of its documentation."""
    found: dict[str, list[dict[str, Any]]] = {}
    order = ""
    for line in text.splitlines():
        words = shlex.split(line, comments=True)
        if not words:
            continue
        if words[0] in ("TELEMETRY", "COMMAND"):
            items = found[f"{words[0]} {words[2]}"] = []
            order = words[3]
        elif words[0].startswith("APPEND"):
            rest = words[4:]
            item = {"keyword": words[0], "name": words[1], "bits": int(words[2]), "kind": words[3], "order": order}
            item |= {"rest": rest, "states": {}}
            if rest[-1].endswith("_ENDIAN"):
                item["order"] = rest[-1]
            items.append(item)
        elif words[0] == "STATE":
            items[-1]["states"][int(words[2])] = words[1]
        else:
            items[-1][words[0]] = words[1:]
    return found


def numbers_of(items: list[dict[str, Any]], body: bytes) -> dict[str, float]:
    """A packet's values by its items, one after the other."""
    values, at = {}, 0
    codes = {("UINT", 8): "B", ("INT", 8): "b", ("UINT", 16): "H", ("INT", 16): "h", ("UINT", 32): "I",
             ("INT", 32): "i", ("FLOAT", 32): "f"}  # fmt: skip
    for item in items:
        code = ("<" if item["order"] == "LITTLE_ENDIAN" else ">") + codes[item["kind"], item["bits"]]
        (number,) = struct.unpack_from(code, body, at)
        at += item["bits"] // 8
        offset, scale = map(float, item.get("POLY_READ_CONVERSION", ("0", "1")))
        values[item["name"]] = offset + scale * number
    assert at == len(body)
    return values


def test_who_reads_the_cosmos_file_decodes_a_wheel_s_replies(wire_map: tuple[str, WireMap], tmp_path: Path) -> None:
    """Each reply is that of one packet by its identifiers, and has the driver's numbers; states have their names."""
    packets = cosmos_packets(exported(wire_map[0], tmp_path / "wheel.txt"))
    telemetry = {name: items for name, items in packets.items() if name.startswith("TELEMETRY")}
    for name, body in bodies(wire_map[1]).items():
        known = [
            key
            for key, items in telemetry.items()
            if all(body[1] == int(i["rest"][0]) for i in items if i["keyword"] == "APPEND_ID_ITEM")
        ]
        assert known == [f"TELEMETRY {name.upper()}"]
        values = numbers_of(telemetry[known[0]], body)
        if name.endswith("_status"):
            assert telemetry[known[0]][2]["states"][int(values["STATUS"])] == "OK"
            continue
        for field, value in in_units_of_the_map(wire_map[1], name, body).items():
            assert values[field.upper()] == pytest.approx(value, rel=1e-12), (name, field)
    for key, items in packets.items():
        if key.startswith("COMMAND"):
            for item in items:
                least, most, default = map(float, item["rest"][:3])
                assert least <= default <= most


def test_frames_of_a_served_wheel_are_decoded(tmp_path: Path) -> None:
    """The telemetry of the simulated wheel as its pty sends it, by the file of COSMOS: its speed and its current."""
    import os
    import time
    import tty

    packets = cosmos_packets(exported("sunspace-wheel", tmp_path / "wheel.txt"))
    with served_wheel(tmp_path, initial_speed_rad_s=100.0, noise_rpm=0.0) as bench:
        line = os.open(bench.port, os.O_RDWR | os.O_NOCTTY)
        try:
            tty.setraw(line)
            os.write(line, encode(31, 137))
            received, end_s = b"", time.monotonic() + 10.0
            while not (frames := decode(received).frames) and time.monotonic() < end_s:
                received += os.read(line, 256)
        finally:
            os.close(line)
    (frame,) = frames
    content = bytes((frame.seq, frame.id)) + frame.data
    values = numbers_of(packets["TELEMETRY CYCLE"], content + crc16(content).to_bytes(2, "little"))
    assert values["SPEED"] == pytest.approx(100.0 * 30.0 / 3.141592653589793, abs=15.0)
    assert (values["CURRENT"], values["BUS_VOLTAGE"], values["PRESSURE"]) == (0.0, 28000.0, 100.0)


def test_what_has_no_such_packets_or_no_map_is_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A family that is not described, and why; no such name; the map itself in the way: one sentence, status 2."""
    out = str(tmp_path / "wheel.xml")
    for name, stated in (
        ("can-wheel", "its DBC"), ("ascii-wheel", "lines of text"),
        ("vesc-wheel", "the mask of its request"),
    ):  # fmt: skip
        assert main(["export", name, out]) == 2
        reported = capsys.readouterr().err
        assert f"{name}: XTCE and COSMOS are written of wire maps of registers alone" in reported
        assert stated in reported
    assert main(["export", "no-such-map", out]) == 2
    assert "no-such-map" in capsys.readouterr().err
    own = tmp_path / "map.txt"
    own.write_text(config_resource("sunspace-wheel").read_text())
    assert main(["export", str(own), str(own)]) == 2
    assert not Path(out).exists()


def test_every_family_is_described_or_says_why_not() -> None:
    """Of each family that ships: packets, or the sentence that `export` answers with."""
    named = [load_protocol(name) for name in FAMILIES]
    assert {type(protocol).__module__ for protocol in named} == {place.split(":")[0] for place in PLACES.values()}
    for protocol in named:
        assert isinstance(protocol, DescribedProtocol) != bool(getattr(protocol, "undescribed", None))


def test_registers_whose_packets_would_have_one_name_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A register that is called as another's reply would hide it."""
    own = tmp_path / "own.yaml"
    own.write_text(OWN_MAP.replace("name: speed\n", "name: limits_status\n"))
    assert main(["export", str(own), str(tmp_path / "wheel.xml")]) == 2
    assert "two packets would be called limits_status" in capsys.readouterr().err


def test_the_json_document_is_the_contract_s(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`--json` prints what docs/contract.md shows."""
    import json

    assert main(["export", "sunspace-wheel", str(tmp_path / "wheel.xml"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    check_document(document)
    assert document["packets"] == 18
