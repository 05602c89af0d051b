"""The frames of a wire map as packets, for programs that define theirs in files: fields, checksums, identifiers."""

from __future__ import annotations

from rw_ekf.driver import WireCrc, WireItem, WirePacket
from rw_ekf.drivers.line.framing import CRCS
from rw_ekf.drivers.line.wire_layout import Field, Register
from rw_ekf.drivers.line.wire_map import WireMap


def packets_of(wire_map: WireMap) -> tuple[WirePacket, ...]:
    """The request and the reply of each register, in the order of the map."""
    found = []
    no_items: tuple[WireItem, ...] = ()
    for register in wire_map.registers:
        fields = tuple(field_item(field, little=wire_map.framing.byte_order == "little") for field in register.fields)
        if register.access == "read":
            wanted, reported = no_items, fields
            names, meanings = (f"read_{register.name}", register.name), ("asks for", "telemetry of")
        else:
            wanted, reported = fields, (_status(wire_map),)
            names, meanings = (register.name, f"{register.name}_status"), ("writes", "what became of a write to")
        for name, items, meaning, is_command in zip(names, (wanted, reported), meanings, (True, False), strict=True):
            packet = _packet(register, items, wire_map)
            found.append(WirePacket(name, is_command, packet, f"{meaning} register {register.id}, {register.name}"))
    return tuple(found)


def _packet(register: Register, items: tuple[WireItem, ...], wire_map: WireMap) -> tuple[WireItem, ...]:
    address = wire_map.framing.address
    addressed = (WireItem("address", "u8", True, "the wheel", constant=address),) if address is not None else ()
    return (
        *addressed,
        WireItem("seq", "u8", True, "number of the request, repeated by its reply"),
        WireItem("id", "u8", True, "register", constant=register.id),
        *items,
        crc_item(wire_map.framing.crc),
    )


def crc_item(kind: str) -> WireItem:
    """The checksum behind everything else."""
    crc = CRCS[kind]
    reported = WireCrc(int(f"{crc.polynomial:016b}"[::-1], 2), crc.start, crc.final)
    return WireItem("crc", "u16", True, f"{kind} over all before it", crc=reported)


def field_item(field: Field, *, little: bool) -> WireItem:
    """A number of a register. little: its low byte comes first."""
    unit = "" if field.unit == "none" else field.unit
    return WireItem(
        field.name, field.type, little, field.name.replace("_", " "), unit, field.scale, field.offset, field.constant
    )


def _status(wire_map: WireMap) -> WireItem:
    return WireItem("status", "u8", True, "whether the write was accepted", states=wire_map.statuses)
