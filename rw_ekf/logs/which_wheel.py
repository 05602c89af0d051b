"""One wheel of a file that holds several: by a group's name, or by the column that tells them apart."""

from __future__ import annotations

import re
from collections.abc import Iterable

from rw_ekf.errors import LogError
from rw_ekf.logs.raw_table import RawTable

MOST_WHEELS = 200  # a column of more different values tells no wheels apart
_PARTS = re.compile(r"[^\s,=/.:]+")  # of `rw_ekf_sample,wheel=rw-y,run=...` and `/wheels/rw-y/sample`
TELLING = re.compile(r"wheel|rw|motor|axis|unit|node|device|serial|name|address|topic|(^|_)(id|dut|esc)", re.IGNORECASE)


def of_wheel(names: Iterable[str], wheel: str) -> list[str]:
    """Those names of groups (series, topics) of which the wheel's name or number is a whole part."""
    return [name for name in names if wheel in _PARTS.findall(name)]


def rows_of_wheel(table: RawTable, wheel: str) -> RawTable:
    """The rows in which the one column that tells wheels apart has this name or number. Raises LogError."""
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
