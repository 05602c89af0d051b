"""What the rows of a log are worth: rows lost from a regular grid, and readings that only repeat the one before.

A row that is lost takes its command with it: what current was in force until the next row is not known. A reading
that is held until the sensor has a new one says nothing in between. Both are told from the rows alone (docs/logs.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array
from rw_ekf.logs.wheel_log import WheelLog

_GAP = 1.5  # periods: a longer step has lost a row
_OFF_GRID = 0.4  # of a period, by which a step may miss a whole number of them: both its ends may be early or late
_ON_GRID = 0.95  # of the gaps must be a whole number of periods; of gaps of any length four in five are
_TURNS, _LONG = 4, 4.0  # rounds in which the period is refined, over steps shorter than so many of it
_MOST_FILLED = 9  # rows of a gap: over more nothing is known of the current
_LEAST_STEPS = 20
_TOLD = 0.005  # share of rows lost that is worth a word
_SAID_FIRST = 0.05  # share lost or held that belongs in front of any verdict
_HELD_SHARE = 0.2  # of the rows of a wheel that turns must repeat
_LATTICE = 1.5  # steps of the lattice: rounding alone changes a reading by one at a time
_FAR = 0.5  # share of the changes that must be further than that
_STANDS = 4.0  # refresh periods without a change: the wheel, not the sensor, may stand still
_TWICE = 1.7  # median runs: two readings in a row that happen to be alike
_LEAST_RUNS = 20
_DOUBT = 0.2  # speed noises that an unknown current may move the wheel by, for good, before the gap is not bridged


@dataclass(eq=False, frozen=True)
class Sampling:
    """How a log was sampled."""

    period_s: float  # of the grid of rows, or the median step where there is none
    lost: int  # rows missing from the grid
    rows: int
    held: BoolArray  # (rows,) readings that only repeat the one before
    refresh_s: float | None  # time after which a reading is new, where readings are held

    @property
    def lost_share(self) -> float:
        """Of the rows there should be, those that are missing."""
        return self.lost / max(self.lost + self.rows, 1)

    @property
    def held_share(self) -> float:
        """Of the rows there are, those that repeat."""
        return float(np.mean(self.held)) if self.held.size else 0.0

    def remarks(self) -> tuple[str, ...]:
        """Sentences without the final stop: what a reader of the log must know first."""
        said = []
        if self.lost_share >= _TOLD:
            rate = 1.0 / self.period_s
            said.append(
                f"rows are lost: {rate * (1.0 - self.lost_share):.3g} samples a second on a {rate:.3g} Hz grid, "
                f"{100.0 * self.lost_share:.2g} % of the rows and their commands are missing"
            )
        if self.refresh_s is not None:
            said.append(
                f"readings are held: {100.0 * self.held_share:.0f} % of the rows repeat the reading before, which is "
                f"refreshed at {1.0 / self.refresh_s:.2g} Hz in rows at {1.0 / self.period_s:.3g} Hz"
            )
        return tuple(said)

    @property
    def said_first(self) -> str:
        """The remarks as a sentence in front of a verdict; empty where little is lost."""
        if self.lost_share < _SAID_FIRST and self.held_share < _SAID_FIRST:
            return ""
        text = "; ".join(self.remarks())
        return f"{text[:1].upper()}{text[1:]}. " if text else ""


def sampling_of(log: WheelLog) -> Sampling:
    """Look at the rows of a log."""
    same = np.diff(log.segment) == 0
    step = np.diff(log.time_s)
    period = _grid(step[same])
    held, refresh = held_readings(log.speed_rad_s, log.segment)
    if period is None:
        usual = float(np.median(step[same])) if same.any() else math.nan
        return Sampling(usual, 0, len(log), held, None if refresh is None else refresh * usual)
    lost = np.round(step[same] / period) - 1.0
    return Sampling(
        period, int(np.sum(lost[lost > 0.0])), len(log), held, None if refresh is None else refresh * period
    )


def _grid(step_s: Float64Array) -> float | None:
    """Period of the grid that rows stand on, some of them lost; None where steps are of any length."""
    if step_s.size < _LEAST_STEPS:
        return None
    shortest = float(np.quantile(step_s, 0.05))
    if shortest <= 0.0:
        return None
    period = float(np.median(step_s[step_s < _GAP * shortest]))
    for _ in range(_TURNS):  # of rows that come early and late, the shortest steps are no period
        counted = np.maximum(np.round(step_s / period), 1.0)
        whole = counted < _LONG
        period = float(step_s[whole].sum() / counted[whole].sum())
    gaps = step_s[step_s > _GAP * period] / period
    if gaps.size == 0:
        return period
    whole = np.abs(gaps - np.round(gaps)) < _OFF_GRID
    return period if float(np.mean(whole)) >= _ON_GRID else None


def held_readings(speed: Float64Array, segment: Int64Array) -> tuple[BoolArray, float | None]:
    """Readings (n,) that a sensor or a register only repeats, and the rows from one new reading to the next.

    A coarse grid repeats readings too, but then they change by one step of the grid; a slow sensor's change by many, at
    about the same number of rows. None, and no reading, where that is not so. Of a wheel that stands each such number
    of rows counts as one reading.
    """
    n = speed.size
    none = np.zeros(n, dtype=bool)
    good = np.isfinite(speed)
    repeat = np.zeros(n, dtype=bool)
    repeat[1:] = (speed[1:] == speed[:-1]) & (segment[1:] == segment[:-1])
    starts = np.flatnonzero(good & ~repeat)
    if starts.size < _LEAST_RUNS or float(np.mean(repeat)) < _HELD_SHARE:
        return none, None
    run = np.diff(np.append(starts, n))
    change = np.abs(np.diff(speed[starts]))
    change = change[change > 0.0]
    moving = run[run <= _STANDS * float(np.median(run))]
    refresh = float(np.mean(run[run < _TWICE * float(np.median(run))]))
    lattice = float(np.quantile(change, 0.02)) if change.size else 0.0
    regular = float(np.quantile(moving, 0.95) - np.quantile(moving, 0.05)) <= max(1.0, 0.5 * refresh)
    if refresh < 1.0 + _HELD_SHARE or not regular or float(np.mean(change > _LATTICE * lattice)) < _FAR:
        return none, None
    place = np.arange(n) - np.maximum.accumulate(np.where(good & ~repeat, np.arange(n), 0))
    fresh = place % max(round(refresh), 1) == 0
    fresh &= (place == 0) | (place >= _STANDS * refresh)
    return repeat & ~fresh, refresh


def mended(log: WheelLog, sampling: Sampling) -> WheelLog:
    """The log as it should be read: lost rows as gaps, repeats as gaps, no belief in a current that is not known.

    The current of lost rows is taken to pass evenly from one row to the next. Where it might have moved the wheel by
    more than a fifth of the readings' noise if it changed at any other moment, the record is cut: a new segment begins.
    The speed keeps what moved it, so that a step far below the noise of one reading shows in the mean of many.
    """
    speed = np.where(sampling.held, np.nan, log.speed_rad_s)
    if sampling.lost == 0:
        return replace(log, speed_rad_s=speed) if sampling.held.any() else log
    step = np.diff(log.time_s)
    same = np.diff(log.segment) == 0
    lost = np.where(same, np.round(step / sampling.period_s) - 1.0, 0.0)
    lost = np.maximum(lost, 0.0).astype(int)
    change = np.abs(np.diff(log.current_A))
    usual = float(np.median(change[same & (lost == 0)])) if (same & (lost == 0)).any() else 0.0
    gain, noise = _rough(log, same & (lost == 0))
    moved = gain * np.maximum(change, usual) * lost * sampling.period_s / math.sqrt(12.0)
    cut = (lost > 0) & ((moved > _DOUBT * noise) | (lost > _MOST_FILLED))
    filled = np.where(cut, 0, lost)
    return _with_rows(replace(log, speed_rad_s=speed), filled, cut)


def _rough(log: WheelLog, regular: BoolArray) -> tuple[float, float]:
    """Acceleration per unit of current, and noise of a reading [rad/s], roughly: from steps without a gap."""
    speed, step = log.speed_rad_s, np.diff(log.time_s)
    asked = np.diff(speed)[regular] / step[regular]
    middle = 0.5 * (speed[1:] + speed[:-1])[regular]
    A = np.column_stack((log.current_A[:-1][regular], np.sign(middle), middle))
    kept = np.isfinite(asked) & np.isfinite(middle)
    third = np.diff(speed, 3)
    third = third[np.isfinite(third)]
    noise = float(np.median(np.abs(third))) / 0.6745 / math.sqrt(20.0) if third.size else 0.0
    if kept.sum() < 10:
        return 0.0, noise
    return abs(float(np.linalg.lstsq(A[kept], asked[kept], rcond=None)[0][0])), noise


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
