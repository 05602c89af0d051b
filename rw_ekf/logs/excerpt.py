"""Stretches of a log that is too long to be held, evenly spread over it: what a diagnosis looks at is among them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.arrays import Int64Array
from rw_ekf.logs import long_log
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.in_parts import UnsoundError
from rw_ekf.logs.long_log import LongLog, long_log_of
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.wheel_log import CHANNELS, WheelLog

# A diagnosis looks at 50,000 samples, in eight pairs of blocks or more (rw_ekf.diagnosis.prepare.split): each of these
# stretches is several of its blocks at ten samples a second.
_STRETCHES = 32


def read_log_or_excerpt(path: str | Path, columns: ColumnMap | None = None) -> WheelLog:
    """A log, or the stretches of one that is too long to be held, each a segment of its own. Raises as `read_log`."""
    long = long_log_of(Path(path), columns or ColumnMap(), None)
    if long is not None:
        try:
            return excerpt(long)
        except UnsoundError:
            pass
    return read_log(path, columns)


def excerpt(log: LongLog) -> WheelLog:
    """Stretches of a log: a thirty-second of what may be held at the beginning of each thirty-second of its rows."""
    span, stretch = max(len(log) // _STRETCHES, 1), long_log.LONG_ROWS // _STRETCHES
    kept: list[WheelLog] = []
    numbers: list[Int64Array] = []  # of the rows in the log
    for part in log.parts():
        number = part.first_row + np.arange(len(part.log) - part.begin)
        inside = np.flatnonzero((number % span < stretch) & (number // span < _STRETCHES))
        if inside.size:
            kept.append(part.log.rows(inside + part.begin))
            numbers.append(number[inside])
        last = part.log
    return _together(kept, np.concatenate(numbers), replace(last, warnings=log.warnings, whole=log), len(log))


def _together(kept: list[WheelLog], number: Int64Array, last: WheelLog, rows: int) -> WheelLog:
    """The rows that were kept as one log; a new segment begins where rows are left out, and where the log has one."""
    opens = np.diff(number, prepend=number[:1]) > 1
    begin = 0
    for log in kept:
        opens[begin + 1 : begin + len(log)] |= np.diff(log.segment) != 0
        begin += len(log)
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(log, name) for log in kept])
        for name in ("time_s", "speed_rad_s", "current_A", "command_delay_s")
    }
    names = [name for name in CHANNELS if name in last.channels]
    return replace(
        last,
        **arrays,
        segment=np.cumsum(opens).astype(np.int64),
        channels={name: np.concatenate([log.channels[name] for log in kept]) for name in names},
        other={name: _below_each_other([log.other[name] for log in kept]) for name in last.other},
        left_out=rows - number.size,
    )


def _below_each_other(columns: list[Any]) -> Any:
    import pyarrow as pa

    return pa.concat_arrays(columns)
