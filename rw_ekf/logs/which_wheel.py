"""One wheel of a file that holds several: by a group's name, or by the column that distinguishes them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable

from rw_ekf.errors import LogError
from rw_ekf.logs.raw_table import RawTable

MOST_WHEELS = 200  # a column of more different values distinguishes no wheels
_PARTS = re.compile(r"[^\s,=/.:]+")  # of `rw_ekf_sample,wheel=rw-y,run=...` and `/wheels/rw-y/sample`
TELLING = re.compile(r"wheel|rw|motor|axis|unit|node|device|serial|name|address|topic|(^|_)(id|dut|esc)", re.IGNORECASE)
_DEVICE = re.compile(  # RW1; wheel A; left motor
    r"(?<![^\W\d_])(?:(?:left|right|front|rear|upper|lower)[ _-]?(?:wheel|motor|rw)|"
    r"(?:reaction[ _-]?wheel|wheel|rw|motor|axis|unit|node|esc|rad|achse)[\s_.:#-]*(?:\d+|[a-z])(?![^\W_]))",
    re.IGNORECASE,
)
_OF_A_RUN = re.compile(
    r"(?<![^\W\d_])(?:runs?|tests?|trials?|cycles?|lauf|versuch|messung|essai)(?![^\W\d_])", re.IGNORECASE
)


def of_wheel(names: Iterable[str], wheel: str) -> list[str]:
    """Those names of groups (series, topics) of which the wheel's name or number is a whole part."""
    return [name for name in names if wheel in _PARTS.findall(name)]


def rows_of_wheel(table: RawTable, wheel: str) -> RawTable:
    """The rows in which the one column that distinguishes wheels has this name or number. Raises LogError."""
    reported = {
        index: held
        for index, name in enumerate(table.names)
        if TELLING.search(name) and (held := table.distinct(index, MOST_WHEELS))
    }
    found = [index for index, held in reported.items() if wheel in held]
    if len(found) == 1:
        return table.of_only(found[0], wheel)
    if found:
        columns = ", ".join(repr(table.names[index]) for index in found)
        raise LogError(f"{table.path}: wheel {wheel!r} stands in {columns}: say which by `only` in a column map")
    columns = "; ".join(f"{table.names[index]!r} holds {', '.join(held[:8])}" for index, held in reported.items())
    raise LogError(
        f"{table.path}: nothing in it is of a wheel {wheel!r}: {columns or 'no column or group tells wheels apart'}. "
        "Where another does, name it by `only` or `variable` in a column map"
    )


def named_by_device(names: tuple[str, ...], above: tuple[str, ...]) -> tuple[str, ...]:
    """Names that come again below another device each, `RW1,,,RW2,,` above them, with the device in front."""
    alike = Counter(names)
    labels = {name: {label for label, other in zip(above, names, strict=False) if other == name} for name in alike}
    devices = [_DEVICE.search(label) for label in above]
    which = {match[0].lower() for match in devices if match is not None}
    whole = all(alike[name] == len(labels[name]) == len(which) > 1 for name in names) and None not in devices
    whole = whole and not any(map(_OF_A_RUN.search, above))
    return tuple(f"{label} {name}" for label, name in zip(above, names, strict=True)) if whole else names
