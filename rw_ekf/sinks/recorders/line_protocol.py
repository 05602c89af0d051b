r"""InfluxDB's line protocol: name,tag=value field=value,field=value STAMP.

https://docs.influxdata.com/influxdb/v2/reference/syntax/line-protocol/: commas and blanks, in tags and keys of fields
also equal signs, have a stroke before them; in a text that is a field's value, quotes and strokes.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

_TEXT = str.maketrans({'"': r"\"", "\\": r"\\", "\n": " ", "\r": " "})


def point(name: str, tags: Mapping[str, str], fields: Mapping[str, Any], stamp_ns: int) -> bytes | None:
    """One line, with its end; None where no field is known. fields: numbers, truths, texts, or None."""
    known = [f"{_key(key)}={_value(value)}" for key, value in fields.items() if value is not None]
    if not known:
        return None
    told = "".join(f",{_key(key)}={_key(value)}" for key, value in tags.items())
    return f"{_key(name)}{told} {','.join(known)} {stamp_ns}\n".encode()


def _key(text: str) -> str:
    """A name, a key or a tag's value: no line of its own, no stroke at its end, which nothing could escape."""
    plain = re.sub(r"\s", " ", text).rstrip("\\") or "_"
    return re.sub(r"([,= ])", r"\\\1", plain)


def _value(value: float | str | bool) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return f"{value}i"
    return repr(value) if isinstance(value, float) else f'"{value.translate(_TEXT)}"'
