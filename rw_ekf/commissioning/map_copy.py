"""A wire map with other scales: a copy of the file in which the fields that were found wrong are multiplied."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rw_ekf.checking.yaml_loader import load_yaml
from rw_ekf.commissioning.can_map_copy import scale_can_map, scale_field
from rw_ekf.commissioning.dialogue import RefusedError
from rw_ekf.logs.atomic import write_text
from rw_ekf.settings.resources import protocol_path

Factors = Mapping[
    tuple[str, str], float
]  # (name of the field, "read" or "write") -> by how much its values are multiplied
MAP_FILE = "wheel-map.yaml"


def write_corrected_map(name: str, factors: Factors, directory: Path) -> str:
    """Write the map `name` with these factors into directory; its path. Raises RefusedError for a field it has not."""
    import yaml

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
    said = ", ".join(f"{field} ({access}) by {factor:.6g}" for (field, access), factor in factors.items())
    path = directory / MAP_FILE
    head = f"# {source.name}, with scales as `rw-ekf commission` found them: {said}. Comments stand in the original.\n"
    write_text(path, head + str(yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=120)))
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
