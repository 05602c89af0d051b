"""A log as a diagnosis reads it: lost rows and pauses as gaps, and no belief in a current that nobody knows."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.logs.sampling import Sampling, read_anew
from rw_ekf.logs.wheel_log import WheelLog

_AROUND = 5  # changes on either side
_MOST_FILLED = 9  # rows of a gap: over more nothing is known of the current
_PAUSE_S, _PAUSE_PERIODS = 2.0, 5.0  # as the filter has it: after a longer step the speed is begun anew
_RESTS, _DEPARTS = 0.002, 0.1  # of the top speed: what rests, and what has left its rest
_DOUBT = 0.2  # speed noises that an unknown current may move the wheel by, for good, before the gap is not bridged


def mended(log: WheelLog, sampling: Sampling) -> WheelLog:
    """The log as it should be read: lost rows as gaps, repeats as gaps, no belief in a current that is not known.

    The current of lost rows is taken to pass evenly from one row to the next. Where it might have moved the wheel by
    more than a fifth of the readings' noise if it changed at any other moment, the record is cut: a new segment begins.
    The speed keeps what moved it, so that a step far below the noise of one reading shows in the mean of many. Rows of
    no grid (stamps that jitter) are cut where they pause: nobody knows what the command was meanwhile.
    """
    log = _begun_at_rest(read_anew(log, sampling.held), sampling.period_s)
    step = np.diff(log.time_s)
    same = np.diff(log.segment) == 0
    if sampling.lost == 0:
        pause = same & _pauses(step, sampling.period_s)
        return _with_rows(log, np.zeros(step.size, dtype=int), pause) if pause.any() else log
    lost = np.where(same, np.round(step / sampling.period_s) - 1.0, 0.0)
    lost = np.maximum(lost, 0.0).astype(int)
    change = np.abs(np.diff(log.current_A))
    regular = same & (lost == 0)
    gain, noise = _rough(log, regular)
    moved = gain * np.maximum(change, _usual(change, regular)) * lost * sampling.period_s / math.sqrt(12.0)
    cut = (lost > 0) & ((moved > _DOUBT * noise) | (lost > _MOST_FILLED))
    filled = np.where(cut, 0, lost)
    return _with_rows(log, filled, cut)


def _pauses(step_s: Float64Array, period_s: float) -> BoolArray:
    """Which steps (n - 1,) are pauses: long ones, and long beside their neighbours, since rows of a turn slow down."""
    beside = np.maximum(np.append(0.0, step_s)[:-1], np.append(step_s, 0.0)[1:])
    return np.asarray(step_s > _PAUSE_PERIODS * np.maximum(max(_PAUSE_S / _PAUSE_PERIODS, period_s), beside))


def _begun_at_rest(log: WheelLog, period_s: float) -> WheelLog:
    """The log with a row ahead of its begin, and behind each pause, where a wheel rests under what then moves it.

    A command that had flowed for long would have moved it long before: nothing was commanded until then. Without that
    row a model takes the first command for one that always was, and a late answer to it cannot be seen.
    """
    speed, current = log.speed_rad_s, log.current_A
    begins = np.diff(log.segment, prepend=log.segment[:1] - 1) != 0
    begins[1:] |= _pauses(np.diff(log.time_s), period_s)
    heads = np.flatnonzero(begins)
    top = float(np.nanquantile(np.abs(speed), 0.99)) if np.isfinite(speed).any() else 0.0
    found = [h for h, e in zip(heads, [*heads[1:], len(log)], strict=True) if _departs(speed[h:e], current[h:e], top)]
    if not found or not period_s > 0.0:
        return log
    rows = np.sort(np.concatenate((np.arange(len(log)), found)))
    new = np.concatenate((np.diff(rows) == 0, [False]))
    return replace(
        log,
        time_s=np.where(new, log.time_s[rows] - period_s, log.time_s[rows]),
        speed_rad_s=speed[rows],
        current_A=np.where(new, 0.0, current[rows]),
        command_delay_s=np.where(new, 0.0, log.command_delay_s[rows]),
        segment=log.segment[rows],
        channels={name: values[rows] for name, values in log.channels.items()},
        other={},
    )


def _departs(speed_rad_s: Float64Array, current_A: Float64Array, top_rad_s: float) -> bool:
    """Whether a wheel rests in the first row of a stretch and goes the way of a current that stays as it is there."""
    first = float(current_A[0])
    if first == 0.0 or not abs(float(speed_rad_s[0])) <= _RESTS * top_rad_s:
        return False
    changed = np.flatnonzero(current_A != first)
    along = speed_rad_s[: int(changed[0]) if changed.size else current_A.size] * math.copysign(1.0, first)
    along = along[np.isfinite(along)]
    return along.size > 1 and bool(along.max() > _DEPARTS * top_rad_s)


def _usual(change: Float64Array, regular: BoolArray) -> Float64Array:
    """By how much a command may have gone there and back where rows are lost, (n - 1,): as it changes around there.

    The median of all changes, or the mean of those nearby if that is more: a limit that chatters lasts a few rows.
    """
    if not regular.any():
        return np.zeros(change.size)
    around = np.ones(2 * _AROUND + 1)
    known, count = (np.convolve(of, around, "same") for of in (np.where(regular, change, 0.0), regular.astype(float)))
    nearby: Float64Array = known / np.maximum(count, 1.0)
    return np.maximum(nearby, float(np.median(change[regular])))


def _rough(log: WheelLog, regular: BoolArray) -> tuple[float, float]:
    """Acceleration per unit of current, and noise of a reading [rad/s], roughly: from steps without a gap."""
    speed, step = log.speed_rad_s, np.diff(log.time_s)
    wanted = np.diff(speed)[regular] / step[regular]
    middle = 0.5 * (speed[1:] + speed[:-1])[regular]
    A = np.column_stack((log.current_A[:-1][regular], np.sign(middle), middle))
    kept = np.isfinite(wanted) & np.isfinite(middle)
    third = np.diff(speed, 3)
    third = third[np.isfinite(third)]
    noise = float(np.median(np.abs(third))) / 0.6745 / math.sqrt(20.0) if third.size else 0.0
    if kept.sum() < 10:
        return 0.0, noise
    return abs(float(np.linalg.lstsq(A[kept], wanted[kept], rcond=None)[0][0])), noise


def _with_rows(log: WheelLog, filled: NDArray[np.int_], cut: BoolArray) -> WheelLog:
    """The log with so many rows after each (n - 1,), without a speed, and a new segment after each that is cut."""
    n = len(log)
    owner = np.repeat(np.arange(n), np.append(filled, 0) + 1)
    place = np.arange(owner.size) - np.searchsorted(owner, owner)  # 0: the row itself
    following = np.minimum(owner + 1, n - 1)
    share = place / (np.append(filled, 0)[owner] + 1.0)
    new = place > 0

    def between(values: Float64Array) -> Float64Array:
        ends: Float64Array = np.where(new, values[owner] + share * (values[following] - values[owner]), values[owner])
        return ends

    segment = log.segment + np.concatenate(([0], np.cumsum(cut)))
    return replace(
        log,
        time_s=between(log.time_s),
        speed_rad_s=np.where(new, np.nan, log.speed_rad_s[owner]),
        current_A=np.where(new, 0.5 * (log.current_A[owner] + log.current_A[following]), log.current_A[owner]),
        command_delay_s=np.where(new, 0.0, log.command_delay_s[owner]),
        segment=segment[owner],
        channels={name: between(values) for name, values in log.channels.items() if name != "status"},
        other={},
    )
