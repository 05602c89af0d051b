"""What a diagnosis is made of: one log or several of one wheel, mended where rows or readings are missing or wrong."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array
from rw_ekf.course.acting_temperature import acting_temperature
from rw_ekf.course.course import Course
from rw_ekf.diagnosis.prepare.split import running_time
from rw_ekf.diagnosis.thresholds import (
    LEAST_MOVE,
    LEAST_READINGS,
    LEAST_SECONDS,
    MOST_OUTLIERS,
    OUTLIER_CHANGES,
    OUTLIER_NOISES,
    OUTLIERS_AT_EDGES,
    SAME_ROWS,
)
from rw_ekf.errors import ConfigError
from rw_ekf.identify.record_scale import noise_beside_motion, rough_parameters
from rw_ekf.logs.joined import joined, refuse_none_or_twice
from rw_ekf.logs.mending import mended
from rw_ekf.logs.metadata import moment_of, read_metadata
from rw_ekf.logs.sampling import evenly_stamped, sampling_of
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.law import MOST_COLUMNS

_NOISE_OF_MEDIAN = 1.0 / 0.6745
_LEAST_LOGGED, _LEAST_VALUES = 0.5, 8  # of a column that a law may be a function of
_SETTLING_TIMES = 15.0  # as long may be judged of a machine that settles fast: 16 healthy motors of 20 are adequate


@dataclass(eq=False, frozen=True)
class Source:
    """The log that is diagnosed, and what must be reported of it first."""

    log: WheelLog
    course: Course  # the same as filters read it, in a time that only grows
    unfit: str | None  # why the base model cannot be judged on it
    log_of: Int64Array  # (n,) which of the logs a sample belongs to
    parts: tuple[dict[str, Any], ...]  # of each log: its name, samples, rate, where it begins in the joint time
    samples: int  # rows that were read
    rate_hz: float
    first_remark: str  # sentences in front of the verdict, or nothing
    notes: tuple[str, ...]
    timing_doubt_s: float  # by which a reading may be older than its row says
    began_utc_s: float | None = None  # UTC of the first sample, since 1970; None: not known
    columns: tuple[str, ...] = ()  # of the log, that the course has and a law may be a function of

    def acting_temperature(self, lag_s: float, ahead_K: Sequence[float] = ()) -> Float64Array:
        """The temperature that acts (n,), of each log by itself, where each began so much warmer than it was read."""
        course, acts = self.course, np.empty(self.course.samples)
        for number in range(int(self.log_of.max(initial=0)) + 1):
            rows = self.log_of == number
            time_s, segment, read = (
                values[rows] for values in (course.time_s, course.segment, course.temperature_degC)
            )
            acts[rows] = acting_temperature(time_s, segment, read, lag_s, ahead_K[number] if ahead_K else 0.0)
        return acts

    def document(self) -> dict[str, Any]:
        """The first keys of the diagnosis document; `logs` only where there are several."""
        found: dict[str, Any] = {"log": self.log.name, "samples": self.samples, "rate_hz": self.rate_hz}
        return found if len(self.parts) == 1 else found | {"logs": list(self.parts)}


def source_of(logs: Sequence[WheelLog], given: Sequence[str] = ()) -> Source:
    """Look at the rows of each log, mend what is lost, and join them. given: columns that a model requires.

    Raises LogError for no log, wild values, and a log that is given twice.
    """
    refuse_none_or_twice(logs, SAME_ROWS)
    logs = [evenly_stamped(log) for log in logs]
    seen = [sampling_of(log) for log in logs]
    whole = joined([mended(log, sampling) for log, sampling in zip(logs, seen, strict=True)])
    several = len(logs) > 1
    notes, first = [], []
    for log, sampling in zip(logs, seen, strict=True):
        of = f"{log.name}: " if several else ""
        notes += [of + text for text in sampling.remarks()]
        if sampling.first_remark:
            first.append(of + sampling.first_remark)
    parts = tuple(part | {"samples": len(log)} for part, log in zip(whole.parts, logs, strict=True))
    doubts = [s.period_s for s in seen if s.refresh_s is not None]
    log = whole.log
    columns = _columns(log, given)
    course = Course.of_log(_with_running_time(log), columns)
    return Source(
        log=log,
        course=course,
        unfit=_unfit(log, course),
        log_of=whole.log_of,
        parts=parts,
        samples=sum(len(one) for one in logs),
        rate_hz=log.rate_hz if several else logs[0].rate_hz,
        first_remark="".join(first),
        notes=(*notes, *whole.notes),
        timing_doubt_s=max(doubts, default=0.0),
        began_utc_s=None if several else _began_utc_s(log),
        columns=columns,
    )


def _began_utc_s(log: WheelLog) -> float | None:
    """When the log of a run began, by the metadata beside it; None where its clock does not give all of its times."""
    if log.whole is not None or len(log) == 0 or log.segment[-1] != log.segment[0]:
        return None
    try:
        metadata = read_metadata(Path(log.name))
    except (ConfigError, OSError):
        return None
    moment = None if metadata is None else moment_of(metadata.first_sample_utc)
    return None if moment is None else moment.timestamp()


def _columns(log: WheelLog, given: Sequence[str]) -> tuple[str, ...]:
    """Columns that a law may be a function of: those that a model requires, then others that move, three at most."""
    moving = [name for name in log.further_columns if name not in given and _moves(log.numbers(name))]
    return tuple([*given, *moving][:MOST_COLUMNS])


def _moves(values: Float64Array | None) -> bool:
    """Whether a column is a quantity that goes up and down: mostly there, of many values, no clock and no counter."""
    if values is None or np.isfinite(values).mean() < _LEAST_LOGGED:
        return False
    known = values[np.isfinite(values)]
    steps = np.diff(known)
    return bool(np.unique(known).size >= _LEAST_VALUES and (steps > 0.0).any() and (steps < 0.0).any())


def _with_running_time(log: WheelLog) -> WheelLog:
    """The log in a time that only grows: where a segment restarts its clock, it follows on the one before."""
    time = log.time_s
    if time.size < 2 or bool(np.all(np.diff(time) >= 0.0)):
        return log
    return replace(log, time_s=time[0] + running_time(time, log.segment))


def _unfit(log: WheelLog, course: Course) -> str | None:
    """Why the base model cannot be judged on this log; None if it can."""
    speed = course.speed_rad_s[np.isfinite(course.speed_rad_s)]
    least_s = min(LEAST_SECONDS, _SETTLING_TIMES * _settling_time_s(course))
    if speed.size < LEAST_READINGS or log.duration_s < least_s:
        return (
            f"the log has {speed.size} speed reading{'' if speed.size == 1 else 's'} over {log.duration_s:.3g} s; "
            f"{LEAST_READINGS} readings over {least_s:.2g} s are the least that can be judged"
        )
    # Beyond what a few wrong readings are: of a day at rest with minutes of motion a hundredth is all rest.
    share = min(0.01, LEAST_READINGS / speed.size)
    low, high = np.quantile(speed, (share, 1.0 - share))
    top = max(abs(low), abs(high))
    noise = noise_beside_motion(course) or 0.0
    if high - low <= LEAST_MOVE * top or high - low <= 8.0 * noise:
        return "the speed hardly changes in this log, so that any friction fits it"
    return None


def _settling_time_s(course: Course) -> float:
    """Roughly the time in which the machine settles [s]; infinite where the record does not show it.

    A motor that is fed a voltage settles within a tenth of a second: three seconds of it are thirty such times.
    """
    rough = rough_parameters(course, noise_beside_motion(course))
    return 1.0 / rough.viscous if rough is not None and min(rough.motor_gain, rough.viscous) > 0.0 else math.inf


def gross_errors(speed_rad_s: Float64Array, segment: Int64Array) -> BoolArray:
    """Readings (n,) far from the median of the five around them, within a segment; NaN is none.

    A median of five follows a ramp and a corner exactly, and two wrong readings in a row leave it where it was. Far
    means beyond what the noise does and beyond what the wheel's own changes are; none where too many would be.
    """
    n = speed_rad_s.size
    wrong = np.zeros(n, dtype=bool)
    good = np.flatnonzero(np.isfinite(speed_rad_s))
    if good.size < 5:
        return wrong
    speed = speed_rad_s[good]
    block = np.cumsum(np.diff(segment[good], prepend=segment[good][:1]) != 0)
    first, last = np.searchsorted(block, block, side="left"), np.searchsorted(block, block, side="right") - 1
    begin = np.clip(np.arange(good.size) - 2, first, np.maximum(last - 4, first))
    around = np.minimum(begin[:, None] + np.arange(5), last[:, None])
    off = np.abs(speed - np.median(speed[around], axis=1))
    edge = begin != np.arange(good.size) - 2
    noise = _NOISE_OF_MEDIAN * float(np.median(off))
    changes = np.abs(np.diff(speed))[np.diff(block) == 0]
    usual = float(np.quantile(changes, 0.9)) if changes.size else 0.0
    found = off > max(OUTLIER_NOISES * noise, OUTLIER_CHANGES * usual) * np.where(edge, OUTLIERS_AT_EDGES, 1.0)
    if found.mean() <= MOST_OUTLIERS:
        wrong[good[found]] = True
    return wrong
