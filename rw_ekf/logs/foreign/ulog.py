"""ULog, as PX4 writes it."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.format_library import Library, foreign_format
from rw_ekf.logs.foreign.groups import Group, table_of_groups
from rw_ekf.logs.raw_table import RawTable

_PER_SECOND = 1.0e6
_CLOCK = "timestamp"  # [us]


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """Topics as groups; one that was logged by several sensors goes by `topic[0]`, `topic[1]`."""
    import pyulog

    with path.open("rb") as stream, contextlib.redirect_stdout(io.StringIO()):  # it prints what it stumbles over
        log = pyulog.ULog(stream)
    several = {data.name for data in log.data_list if data.multi_id > 0}
    table = table_of_groups([_group(data, several) for data in log.data_list], columns, name)
    if log.file_corruption:
        table.warnings.append(f"{name}: is damaged, and only in part what was logged: what could be read was taken")
    lost_ms = sum(dropout.duration for dropout in log.dropouts)
    if lost_ms:
        table.warnings.append(f"{name}: {len(log.dropouts)} dropouts of {lost_ms} ms together: rows are missing there")
    return table


def _group(data: Any, several: set[str]) -> Group:
    channels = {key: values for key, values in data.data.items() if key != _CLOCK}
    name = f"{data.name}[{data.multi_id}]" if data.name in several else data.name
    return Group(name, np.asarray(data.data[_CLOCK] / _PER_SECOND, dtype=np.float64), channels)


FORMAT = foreign_format(
    "a ULog file",
    lambda head, suffix: head.startswith(b"ULog\x01\x12\x35"),
    "the first bytes 'ULog'",
    _read,
    Library("ulog", ("pyulog",)),
    "convert it with ulog2csv",
)
