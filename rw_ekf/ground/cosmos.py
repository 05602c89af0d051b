"""Packets as COSMOS defines them (https://docs.openc3.com/docs/configuration/telemetry), for cmd_tlm/ of a target."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rw_ekf.driver import WireItem, WirePacket
from rw_ekf.ground.ranges import bits_of, is_plain, number_text, range_of

_KINDS = {"u": "UINT", "i": "INT", "f": "FLOAT"}


def cosmos_text(name: str, packets: Sequence[WirePacket]) -> str:
    """Commands and telemetry of a target of that name, in capitals."""
    target = name.upper().replace("-", "_")
    lines = [
        f"# {target}: what stands between the marks of a frame, escapes undone; the interface frames it, and its",
        "# CrcProtocol fills CRC in and checks it.",
    ]
    for packet in packets:
        lines += ["", *(_command(target, packet) if packet.is_command else _telemetry(target, packet))]
    return "\n".join(lines) + "\n"


def _telemetry(target: str, packet: WirePacket) -> Iterator[str]:
    yield f'TELEMETRY {target} {packet.name.upper()} {_order(packet)} "{packet.meaning}"'
    for item in packet.items:
        size, kind = bits_of(item), _KINDS[item.type[0]]
        if item.constant is not None:
            yield f'  APPEND_ID_ITEM {item.name.upper()} {size} {kind} {int(item.constant)} "{item.meaning}"'
        else:
            yield f'  APPEND_ITEM {item.name.upper()} {size} {kind} "{item.meaning}"{_own_order(item, packet)}'
        if not is_plain(item):
            yield f"    POLY_READ_CONVERSION {number_text(item.offset)} {number_text(item.scale)}"
        yield from _stated(item)


def _command(target: str, packet: WirePacket) -> Iterator[str]:
    yield f'COMMAND {target} {packet.name.upper()} {_order(packet)} "{packet.meaning}"'
    for item in packet.items:
        size, kind, name = bits_of(item), _KINDS[item.type[0]], item.name.upper()
        if item.constant is not None:
            value = int(item.constant)
            keyword = "APPEND_ID_PARAMETER" if item.name == "id" else "APPEND_PARAMETER"
            yield f'  {keyword} {name} {size} {kind} {value} {value} {value} "{item.meaning}"'
            continue
        least, most = (number_text(end) for end in range_of(item))
        yield f'  APPEND_PARAMETER {name} {size} {kind} {least} {most} 0 "{item.meaning}"{_own_order(item, packet)}'
        if not is_plain(item):
            offset, slope = -item.offset / item.scale + 0.0, 1.0 / item.scale
            yield f"    POLY_WRITE_CONVERSION {number_text(offset)} {number_text(slope)}"
        yield from _stated(item)


def _stated(item: WireItem) -> Iterator[str]:
    if item.unit:
        unit = item.unit.replace(" ", "")
        yield f"    UNITS {unit} {unit}"
    for number, label in sorted(item.states.items()):
        yield f"    STATE {label.upper()} {number}"


def _order(packet: WirePacket) -> str:
    """Of most of what is wider than a byte."""
    wide = [item.low_byte_first for item in packet.items if bits_of(item) > 8 and item.crc is None]
    return _named(wide[0] if wide else True)


def _own_order(item: WireItem, packet: WirePacket) -> str:
    own = _named(item.low_byte_first)
    return "" if bits_of(item) == 8 or own == _order(packet) else f" {own}"


def _named(low_byte_first: bool) -> str:
    return "LITTLE_ENDIAN" if low_byte_first else "BIG_ENDIAN"
