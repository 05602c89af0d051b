"""A map of CAN messages with other scales: of the messages in it, or of a copy of the DBC that it names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rw_ekf.logs.atomic import atomic_path

DBC_FILE = "wheel-map.dbc"
_MESSAGE = re.compile(r"\s*BO_\s+\d+\s+(\w+)\s*:")
_SIGNAL = re.compile(r"(\s*SG_\s+(\w+)\s*:[^(]*)\(([^,()]+),([^,()]+)\)\s*\[([^|\]]+)\|([^\]]+)\](.*)", re.DOTALL)


def scale_can_map(
    data: dict[str, Any], factors: Mapping[tuple[str, str], float], folder: Path, directory: Path
) -> set[tuple[str, str]]:
    """Multiply what is told and commanded in a map's content; a DBC of `folder` is copied into `directory`, and named.

    Gives those of the factors that have no place in it; then nothing is to be used.
    """
    places = {(told, "read"): _place(where) for told, where in data["telemetry"].items()}
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
