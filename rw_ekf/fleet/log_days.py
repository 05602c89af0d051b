"""A log taken apart at midnight, UTC: a result is of one wheel and one day, whatever the logs are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

import numpy as np

from rw_ekf.arrays import Int64Array
from rw_ekf.logs.wheel_log import WheelLog

_DAY_S = 86_400.0
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True)
class DayOfLog:
    """The rows of a log that are of one day."""

    day: str  # 2026-01-31
    begins_utc: datetime
    ends_utc: datetime
    log: WheelLog


def days_of_log(log: WheelLog, begins_utc: datetime) -> list[DayOfLog]:
    """The days of a log that begins then, in their order.

    The log's own time is counted from its first row. Where it begins anew, in another segment, the clock of the day
    continues from the last row before: how long the pause was is not known.
    """
    steps_s = np.diff(log.time_s, prepend=log.time_s[:1])
    steps_s[1:][np.diff(log.segment) != 0] = 0.0
    first_s = (begins_utc - _EPOCH).total_seconds()
    clock_s = first_s + np.cumsum(np.maximum(steps_s, 0.0))
    number = np.floor(clock_s / _DAY_S).astype(np.int64)
    starts = np.flatnonzero(np.diff(number, prepend=number[0] - 1))
    ends = np.append(starts[1:], len(log))
    return [
        DayOfLog(
            (_EPOCH + timedelta(days=int(number[a]))).date().isoformat(),
            _EPOCH + timedelta(seconds=float(clock_s[a])),
            _EPOCH + timedelta(seconds=float(clock_s[b - 1])),
            log if len(starts) == 1 else rows_of(log, np.arange(a, b)),
        )
        for a, b in zip(starts, ends, strict=True)
    ]


def rows_of(log: WheelLog, rows: Int64Array) -> WheelLog:
    """Some rows of a log, in their order."""
    return replace(
        log.rows(rows), segment=log.segment[rows] - log.segment[rows[0]], rows_read=rows.size, skipped_rows=0
    )
