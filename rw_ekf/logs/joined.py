"""Several logs of one wheel as one: one after the other in running time, each with a start and a clock of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from rw_ekf.arrays import Complex128Array, Float64Array, Int64Array
from rw_ekf.errors import LogError
from rw_ekf.logs.wheel_log import WheelLog, put_together

SAME_ROWS = 0.9  # share of rows beyond which two logs are one: two runs do not read the same noise
_LEAST_ROWS = 100  # of a log in which that is tested
_MISSING = 1.0e300  # in place of a speed, where rows are compared
_UNLIKE_NOISE = 2.0  # factor between the noises of two logs that is worth a word


@dataclass(eq=False, frozen=True)
class Joined:
    """One log made of several, and which of them each sample (n,) came from."""

    log: WheelLog
    log_of: Int64Array
    parts: tuple[dict[str, Any], ...]  # of each log: its name, samples, rate, and where it begins in the joint time
    notes: tuple[str, ...] = ()


def joined(logs: Sequence[WheelLog]) -> Joined:
    """Join logs; a single one stays as it is.

    In the joint time a log begins one sample after the one before ended: what happened between is not known. A channel
    that one of them lacks is left out. Every log is a segment of its own at least: each has its own first speed.
    """
    if len(logs) == 1:
        log = logs[0]
        return Joined(log, np.zeros(len(log), dtype=np.int64), (_part(log, 0.0),))
    names = set.intersection(*(set(log.channels) for log in logs))
    lacking = sorted(set.union(*(set(log.channels) for log in logs)) - names)
    notes = (f"{', '.join(lacking)}: not in every log, and not used",) if lacking else ()
    moved, parts, begin, number = list[WheelLog](), [], 0.0, 0
    for log in logs:
        parts.append(_part(log, begin))
        time_s, segment = begin + _running(log), log.segment - log.segment[:1] + number
        channels = {name: log.channels[name] for name in sorted(names)}
        moved.append(replace(log, time_s=time_s, segment=segment, channels=channels, other={}))
        number = int(segment[-1]) + 1
        begin = float(time_s[-1]) + (1.0 / log.rate_hz if np.isfinite(log.rate_hz) else 1.0)
    whole = replace(
        put_together(moved),
        name=", ".join(log.name for log in logs),
        other=_further(logs),
        rows_read=sum(log.rows_read for log in logs),
        skipped_rows=sum(log.skipped_rows for log in logs),
        left_out=sum(log.left_out for log in logs),
        warnings=tuple(f"{log.name}: {text}" for log in logs for text in log.warnings),
    )
    log_of = np.repeat(np.arange(len(logs)), [len(log) for log in logs]).astype(np.int64)
    return Joined(whole, log_of, tuple(parts), (*notes, *_unlike(logs)))


def one_log(logs: Sequence[WheelLog]) -> WheelLog:
    """Logs joined, with the remarks on them among the warnings. Raises LogError for none, and for one given twice."""
    refuse_none_or_twice(logs)
    whole = joined(logs)
    return replace(whole.log, warnings=(*whole.log.warnings, *whole.notes))


def refuse_none_or_twice(logs: Sequence[WheelLog], same_rows: float = SAME_ROWS) -> None:
    """Raise LogError where there is no log, or nearly all rows of one are rows of another and would count twice."""
    if not logs:
        raise LogError("no log was given: name one, or several of one wheel")
    for (first, one), (second, other) in combinations(enumerate(logs, 1), 2):
        shared, least = int(np.isin(_rows(other), _rows(one)).sum()), min(len(one), len(other))
        if least >= _LEAST_ROWS and shared >= same_rows * least:
            this, that = other.name, one.name
            if this == that:  # tables in memory, or one path
                this, that = f"{this}, log {second}", f"log {first}"
            raise LogError(
                f"{this}: {shared} of its {len(other)} rows are rows of {that}, time and speed: what they say would "
                "count twice; name one of the two"
            )


def _rows(log: WheelLog) -> Complex128Array:
    """Time and speed of each row as one number that can be sorted; a missing speed is like any other."""
    return log.time_s + 1j * np.where(np.isfinite(log.speed_rad_s), log.speed_rad_s, _MISSING)


def _further(logs: Sequence[WheelLog]) -> dict[str, Any]:
    """Logged numbers of no name of ours that every log has."""
    import pyarrow as pa

    names = set.intersection(*(set(log.other) & set(log.further_columns) for log in logs))
    columns = {name: [values for log in logs if (values := log.numbers(name)) is not None] for name in sorted(names)}
    return {name: pa.array(np.concatenate(values)) for name, values in columns.items()}


def _part(log: WheelLog, begin_s: float) -> dict[str, Any]:
    return {"log": log.name, "samples": len(log), "rate_hz": log.rate_hz, "begins_s": begin_s}


def _running(log: WheelLog) -> Float64Array:
    """Time since the log's first sample [s], (n,), steps into a new segment as long as a sample at most."""
    step = np.diff(log.time_s, prepend=log.time_s[:1])
    period = 1.0 / log.rate_hz if np.isfinite(log.rate_hz) else 1.0
    jumps = np.diff(log.segment, prepend=log.segment[:1]) != 0
    step[jumps & ((step < 0.0) | (step > period))] = period
    running: Float64Array = np.cumsum(step)
    return running


def _unlike(logs: Sequence[WheelLog]) -> tuple[str, ...]:
    """A word where the readings of one log are much noisier than those of another: one noise is taken for all."""
    noises = []
    for log in logs:
        third = np.diff(log.speed_rad_s, 3)
        third = third[np.isfinite(third)]
        noises.append(float(np.median(np.abs(third))) if third.size else 0.0)
    low, high = min(noises), max(noises)
    if low <= 0.0 or high < _UNLIKE_NOISE * low:
        return ()
    return (
        f"the readings of {logs[int(np.argmax(noises))].name} are {high / low:.2g} times as noisy as those of "
        f"{logs[int(np.argmin(noises))].name}; one noise is taken for all",
    )
