"""Packets as XTCE 1.2 (https://www.omg.org/spec/XTCE/1.2), which Yamcs and other ground systems read.

Replies are containers that inherit `Reply` and are identified by its constant; requests are commands. What surrounds a
packet on the line (marks, escapes) is the concern of what reads the line: XTCE begins where they are undone.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from xml.etree import ElementTree

from rw_ekf.driver import WireCrc, WireItem, WirePacket
from rw_ekf.ground.ranges import bits_of, is_plain, number_text, range_of
from rw_ekf.version import __version__

NAMESPACE = "http://www.omg.org/spec/XTCE/20180204"
_SCHEMA = f"{NAMESPACE} https://www.omg.org/spec/XTCE/20180204/SpaceSystem.xsd"
_ENCODINGS = {"u": "unsigned", "i": "twosComplement"}

Element = ElementTree.Element


def xtce_text(name: str, packets: Sequence[WirePacket]) -> str:
    """The document of a space system of that name."""
    root = Element(
        "SpaceSystem", {"name": name, "xmlns": NAMESPACE, "xmlns:xsi": "http://www.w3.org/2001/XMLSchema-instance"}
    )
    root.set("xsi:schemaLocation", _SCHEMA)
    _add(root, "Header", version=__version__, validationStatus="Working")
    _telemetry(_add(root, "TelemetryMetaData"), [packet for packet in packets if not packet.is_command])
    _commands(_add(root, "CommandMetaData"), [packet for packet in packets if packet.is_command])
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _telemetry(within: Element, replies: list[WirePacket]) -> None:
    types, parameters, containers = (_add(within, tag) for tag in ("ParameterTypeSet", "ParameterSet", "ContainerSet"))
    named: dict[str, WireItem] = {}
    base = _add(containers, "SequenceContainer", name="Reply", abstract="true")
    entries = _add(base, "EntryList")
    size = _head_size(replies)
    for item in replies[0].items[:size]:
        named[item.name] = item
        _add(entries, "ParameterRefEntry", parameterRef=item.name)
    for packet in replies:
        container = _add(containers, "SequenceContainer", name=packet.name, shortDescription=packet.meaning)
        entries = _add(container, "EntryList")
        reported_by = packet.items[size - 1]
        for item in packet.items[size:]:
            parameter = item.name if item.crc is not None else f"{packet.name}_{item.name}"
            named[parameter] = item
            _add(entries, "ParameterRefEntry", parameterRef=parameter)
        criteria = _add(_add(container, "BaseContainer", containerRef="Reply"), "RestrictionCriteria")
        _add(criteria, "Comparison", parameterRef=reported_by.name, value=str(int(reported_by.constant or 0)))
    for name, item in named.items():
        _type(types, "Parameter", f"{name}_type", item)
        sentence_about = {"shortDescription": item.meaning} if item.meaning else {}
        _add(parameters, "Parameter", name=name, parameterTypeRef=f"{name}_type", **sentence_about)


def _commands(within: Element, requests: list[WirePacket]) -> None:
    checksums = next(([item] for packet in requests for item in packet.items if item.crc is not None), [])
    if checksums:
        types, parameters = _add(within, "ParameterTypeSet"), _add(within, "ParameterSet")
        for item in checksums:
            _type(types, "Parameter", f"request_{item.name}_type", item)
            _add(parameters, "Parameter", name=f"request_{item.name}", parameterTypeRef=f"request_{item.name}_type")
    types, commands = _add(within, "ArgumentTypeSet"), _add(within, "MetaCommandSet")
    for packet in requests:
        command = _add(commands, "MetaCommand", name=packet.name, shortDescription=packet.meaning)
        free = any(item.crc is None and item.constant is None for item in packet.items)
        arguments = _add(command, "ArgumentList") if free else command  # an empty one is none
        entries = _add(_add(command, "CommandContainer", name=f"{packet.name}_packet"), "EntryList")
        for item in packet.items:
            if item.crc is not None:
                _add(entries, "ParameterRefEntry", parameterRef=f"request_{item.name}")
            elif item.constant is not None:
                size = str(bits_of(item))
                _add(entries, "FixedValueEntry", name=item.name, binaryValue=_hex(item), sizeInBits=size)
            else:
                kind = f"{packet.name}_{item.name}_type"
                _type(types, "Argument", kind, item)
                initial = {"initialValue": "0"} if item.name == "seq" else {}
                _add(arguments, "Argument", name=item.name, argumentTypeRef=kind, **initial)
                _add(entries, "ArgumentRefEntry", argumentRef=item.name)


def _type(within: Element, use: str, name: str, item: WireItem) -> None:
    """The type of a parameter or of an argument. use: "Parameter" or "Argument"."""
    whole = item.type[0] != "f" and is_plain(item)
    if item.states:
        kind = _add(within, f"Enumerated{use}Type", name=name)
    elif whole:
        signed = "true" if item.type[0] == "i" else "false"
        kind = _add(within, f"Integer{use}Type", name=name, signed=signed, sizeInBits=str(bits_of(item)))
    else:
        kind = _add(within, f"Float{use}Type", name=name, sizeInBits="64")
    units = _add(kind, "UnitSet")
    if item.unit:
        _add(units, "Unit").text = item.unit
    _encoding(kind, item)
    if item.states:
        states = _add(kind, "EnumerationList")
        for number, label in sorted(item.states.items()):
            _add(states, "Enumeration", value=str(number), label=label)
    elif item.crc is None:
        least, most = range_of(item)
        ends = {"minInclusive": _end(least, whole=whole), "maxInclusive": _end(most, whole=whole)}
        holder = kind if use == "Parameter" else _add(kind, "ValidRangeSet")
        _add(holder, "ValidRange", **ends)


def _encoding(kind: Element, item: WireItem) -> None:
    order = {} if bits_of(item) == 8 or not item.low_byte_first else {"byteOrder": "leastSignificantByteFirst"}
    if item.type[0] == "f":
        encoding = _add(kind, "FloatDataEncoding", sizeInBits=str(bits_of(item)), encoding="IEEE754_1985", **order)
    else:
        carried = _ENCODINGS[item.type[0]]
        encoding = _add(kind, "IntegerDataEncoding", sizeInBits=str(bits_of(item)), encoding=carried, **order)
    if item.crc is not None:
        _checksum(_add(encoding, "ErrorDetectCorrect"), item.crc)
    if not is_plain(item):
        polynomial = _add(_add(encoding, "DefaultCalibrator"), "PolynomialCalibrator")
        for exponent, coefficient in enumerate((item.offset, item.scale)):
            _add(polynomial, "Term", coefficient=number_text(coefficient), exponent=str(exponent))


def _checksum(within: Element, crc: WireCrc) -> None:
    reported = _add(within, "CRC", width="16", reflectData="true", reflectRemainder="true")
    for tag, value in (("Polynomial", crc.polynomial), ("InitRemainder", crc.start), ("FinalXOR", crc.final)):
        _add(reported, tag).text = f"{value:04X}"


def _head_size(packets: Sequence[WirePacket]) -> int:
    """How many items there are up to the one by whose constant packets are distinguished: an address is that of all."""
    columns = zip(*(packet.items for packet in packets), strict=False)
    constants = [[item.constant for item in column] for column in columns]
    fixed = [index for index, column in enumerate(constants) if None not in column]
    return 1 + next((index for index in fixed if len(set(constants[index])) > 1), fixed[0])


def _hex(item: WireItem) -> str:
    """The bytes of a constant."""
    number, order = item.constant or 0.0, "<" if item.low_byte_first else ">"
    code = {"u8": "B", "i8": "b", "u16": "H", "i16": "h", "u32": "I", "i32": "i", "f32": "f"}[item.type]
    return struct.pack(order + code, number if code == "f" else int(number)).hex().upper()


def _end(value: float, *, whole: bool) -> str:
    return str(int(value)) if whole else number_text(value)


def _add(within: Element, tag: str, **attributes: str) -> Element:
    return ElementTree.SubElement(within, tag, attributes)
