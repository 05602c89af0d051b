"""A log format: a line of magic, then rows of time [ms], speed [rpm] and current [mA] as they came."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rw_ekf.errors import LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.log_format import LogFormat
from rw_ekf.logs.raw_table import RawTable

_MAGIC = b"ACME recorder"


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    try:
        rows = np.loadtxt(path, skiprows=1, ndmin=2)
    except ValueError as error:
        raise LogError(f"{name}: is a damaged recording ({error})") from None
    time_s, speed_rpm, current_A = 1e-3 * rows[:, 0], rows[:, 1], 1e-3 * rows[:, 2]
    names = ("time_s", "speed_rpm", "current_command_A")
    return RawTable(name, names, [time_s, speed_rpm, current_A], len(rows), lambda row: f"line {row + 2}")


FORMAT = LogFormat(lambda head, suffix: head.startswith(_MAGIC), _read)
