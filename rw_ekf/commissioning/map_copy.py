"""A map with other scales: a copy of the file in which the fields that were found wrong are multiplied.

Of CAN messages the messages in it are, or those of a copy of the DBC that it names.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rw_ekf.checking.yaml_loader import load_yaml
from rw_ekf.checking.yaml_text import yaml_text
from rw_ekf.commissioning.dialogue import RefusedError
from rw_ekf.logs.atomic import atomic_path, write_text
from rw_ekf.settings.resources import protocol_path

Factors = Mapping[
    tuple[str, str], float
]  # (name of the field, "read" or "write") -> by how much its values are multiplied
MAP_FILE = "wheel-map.yaml"
DBC_FILE = "wheel-map.dbc"
_MESSAGE = re.compile(r"\s*BO_\s+\d+\s+(\w+)\s*:")
_SIGNAL = re.compile(r"(\s*SG_\s+(\w+)\s*:[^(]*)\(([^,()]+),([^,()]+)\)\s*\[([^|\]]+)\|([^\]]+)\](.*)", re.DOTALL)


def scale_can_map(
    data: dict[str, Any], factors: Mapping[tuple[str, str], float], folder: Path, directory: Path
) -> set[tuple[str, str]]:
    """Multiply what is read and commanded in a map's content; a DBC of `folder` is copied into `directory` and named.

    Gives those of the factors that have no place in it; then nothing is to be used.
    """
    places = {(reported, "read"): _place(where) for reported, where in data["telemetry"].items()}
    places["current_command", "write"] = _place(data["command"])
    missing = {key for key in factors if key not in places}
    by_place: dict[str, float] = {}
    for key in factors.keys() - missing:
        by_place[places[key]] = by_place.get(places[key], 1.0) * factors[key]
    done = set()
    for message in data.get("messages", ()):
        for signal in message.get("signals", ()):
            place = f"{message['name']}.{signal['name']}"
            if place in by_place:
                scale_field(signal, by_place[place])
                done.add(place)
    if "dbc" in data:
        # Every byte of a DBC is a character of Latin-1: what is not changed stays as it is.
        text, done = scaled_dbc((folder / data["dbc"]).read_bytes().decode("latin-1"), by_place)
        with atomic_path(directory / DBC_FILE) as temporary:
            temporary.write_bytes(text.encode("latin-1"))
        data["dbc"] = DBC_FILE
    return missing | {key for key in factors if places.get(key) not in done}


def scale_field(field: dict[str, Any], factor: float) -> None:
    """Multiply the values of a field or signal: its scale, and its offset where it has one."""
    if factor != 1.0:
        field["scale"] = float(f"{field.get('scale', 1.0) * factor:.15g}")
        if field.get("offset"):
            field["offset"] = float(f"{field['offset'] * factor:.15g}")


def scaled_dbc(text: str, factors: Mapping[str, float]) -> tuple[str, set[str]]:
    """A DBC's text with the values of signals (Message.Signal) multiplied, and which of them were found."""
    lines, found, message = [], set(), ""
    for line in text.splitlines(keepends=True):
        if begins := _MESSAGE.match(line):
            message = begins[1]
        signal = _SIGNAL.match(line)
        place = f"{message}.{signal[2]}" if signal else ""
        if signal is None or place not in factors:
            lines.append(line)
            continue
        found.add(place)
        scale, offset, low, high = (float(number) * factors[place] for number in signal.groups()[2:6])
        low, high = sorted((low, high))
        lines.append(f"{signal[1]}({scale:.15g},{offset:.15g}) [{low:.15g}|{high:.15g}]{signal[7]}")
    return "".join(lines), found


def _place(where: Any) -> str:
    """Message.Signal of what stands in a map as that, or as a table with it."""
    return str(where["signal"] if isinstance(where, Mapping) else where)


def write_corrected_map(name: str, factors: Factors, directory: Path) -> str:
    """Write the map `name` with these factors into directory; its path. Raises RefusedError for a field it has not."""
    source = protocol_path(name)
    data = load_yaml(source).data
    if data.get("family") == "can":
        missing = scale_can_map(data, factors, source.parent, directory)
    else:
        missing = {key for key in factors if not any(_matches(key, field, access) for field, access in _fields(data))}
        for field, access in list(_fields(data)):
            scale_field(field, math.prod(value for key, value in factors.items() if _matches(key, field, access)))
    if missing:
        named = ", ".join(sorted(field for field, _ in missing))
        raise RefusedError(
            f"the wire map {name} must have another scale of {named}, and its file has no such key to change"
        )
    stated = ", ".join(f"{field} ({access}) by {factor:.6g}" for (field, access), factor in factors.items())
    path = directory / MAP_FILE
    head = (
        f"# {source.name}, with scales as `rw-ekf commission` found them: {stated}. Comments stand in the original.\n"
    )
    write_text(path, head + yaml_text(data, default_flow_style=None, width=120))
    return str(path.absolute())


def _matches(key: tuple[str, str], field: Mapping[str, Any], access: str) -> bool:
    return field.get("name") == key[0] and access in (key[1], "")


def _fields(data: Any, access: str = "") -> Iterator[tuple[dict[str, Any], str]]:
    """Every field of a map with the access of the register around it, whatever the family calls the levels above."""
    if isinstance(data, dict):
        access = str(data.get("access", access))
        if "name" in data and "fields" not in data and ({"type", "scale", "unit"} & data.keys()):
            yield data, access
        for value in data.values():
            yield from _fields(value, access)
    elif isinstance(data, list):
        for value in data:
            yield from _fields(value, access)
