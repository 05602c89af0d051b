"""Stretches of a log that is too long to be held, evenly spread over it: what a diagnosis looks at is among them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from rw_ekf.arrays import Int64Array
from rw_ekf.checking.paths import path_of
from rw_ekf.logs import long_log
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.in_parts import UnsoundError
from rw_ekf.logs.long_log import LongLog, long_log_of
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.wheel_log import WheelLog, put_together

# A diagnosis looks at 50,000 samples, in eight pairs of blocks or more (rw_ekf.diagnosis.prepare.split): each of these
# stretches is several of its blocks at ten samples a second.
_STRETCHES = 32


def read_log_or_excerpt(path: str | Path, columns: ColumnMap | None = None) -> WheelLog:
    """A log, or the stretches of one that is too long to be held, each a segment of its own. Raises as `read_log`."""
    long = long_log_of(path_of(path, "a log"), columns or ColumnMap(), None)
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
    number = np.concatenate(numbers)
    opens = np.diff(number, prepend=number[:1]) > 1  # a segment, where rows are left out and where the log has one
    begin = 0
    for one in kept:
        opens[begin + 1 : begin + len(one)] |= np.diff(one.segment) != 0
        begin += len(one)
    return replace(
        put_together(kept),
        segment=np.cumsum(opens).astype(np.int64),
        rows_read=last.rows_read,
        skipped_rows=last.skipped_rows,
        warnings=log.warnings,
        faults=last.faults,
        left_out=len(log) - number.size,
        whole=log,
    )
