"""What the rows of a log are worth: rows lost from a regular grid, and readings that only repeat the one before.

A row that is lost takes its command with it: what current was in force until the next row is not known. A reading
that is held until the sensor has a new one says nothing in between. Both are found from the rows alone (docs/logs.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.numbers import number_text

_GAP = 1.5  # periods: a longer step has lost a row
_OFF_GRID = 0.4  # of a period, by which a step may miss a whole number of them: both its ends may be early or late
_ON_GRID = 0.95  # of the gaps must be a whole number of periods; of gaps of any length four in five are
_TURNS, _LONG = 4, 4.0  # rounds in which the period is refined, over steps shorter than so many of it
_SPARSE = 5.0  # periods a row: where more are lost it is no grid, but rows that come in batches
_LEAST_STEPS = 20
_REPORTED = 0.005  # share of rows lost that is worth a word
_STATED_FIRST = 0.05  # share lost or held that belongs in front of any verdict
_HELD_SHARE = 0.2  # of the rows of a wheel that turns must repeat
_LATTICE = 1.5  # steps of the lattice: rounding alone changes a reading by one at a time
_FAR = 0.5  # share of the changes that must be further than that
_SOME_FAR, _ALL_REGULAR = 0.2, 0.95  # enough are, where so many of the runs are regular: a hold on a coarse grid
_STANDS = 4.0  # refresh periods without a change: the wheel, not the sensor, may stand still
_ON_TIME = 0.25  # of the refresh, by which a run may miss whole multiples of it: runs of any length reach half of it
_REGULAR = 0.8  # share of the runs that must not: of runs of any length half do not
_EVEN = 0.01  # of the refresh: on a clock of seconds a whole number of them is not quite one
_PAUSE = 0.05  # of a record: a longer step is a pause, and says nothing of how often rows come
_LEAST_RUNS = 20
_IN_BATCHES = 0.25  # of the time per row: half of the steps are shorter, so that most rows came with the one before
_LEAST_BATCHES, _LONGEST_WAIT_S = 20, 1.0  # a logger that sleeps between its bursts sleeps longer, and stamps truly
_ON_CLOCK = 1.5  # of the time a batch waits: so far apart may stamps be from an even clock, early to late


@dataclass(eq=False, frozen=True)
class Sampling:
    """How a log was sampled."""

    period_s: float  # of the grid of rows, or the time per row where there is none
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
        stated = []
        if self.lost_share >= _REPORTED:
            rate = 1.0 / self.period_s
            stated.append(
                f"rows are lost: {rate * (1.0 - self.lost_share):.3g} samples a second on a {rate:.3g} Hz grid, "
                f"{number_text(100.0 * self.lost_share, 2)} % of the rows and their commands are missing"
            )
        if self.refresh_s is not None:
            stated.append(
                f"readings are held: {100.0 * self.held_share:.0f} % of the rows repeat the reading before, which is "
                f"refreshed at {1.0 / self.refresh_s:.2g} Hz in rows at {1.0 / self.period_s:.3g} Hz"
            )
        return tuple(stated)

    @property
    def first_remark(self) -> str:
        """The remarks as a sentence in front of a verdict; empty where little is lost."""
        if self.lost_share < _STATED_FIRST and self.held_share < _STATED_FIRST:
            return ""
        text = "; ".join(self.remarks())
        return f"{text[:1].upper()}{text[1:]}. " if text else ""


def sampling_of(log: WheelLog) -> Sampling:
    """Look at the rows of a log."""
    same = np.diff(log.segment) == 0
    step = np.diff(log.time_s)
    held, refresh_s = held_readings(log)
    period = _grid(step[same])
    if period is None:
        return Sampling(_mean_step(step[same]), 0, len(log), held, refresh_s)
    lost = np.round(step[same] / period) - 1.0
    return Sampling(period, int(np.sum(lost[lost > 0.0])), len(log), held, refresh_s)


def evenly_stamped(log: WheelLog) -> WheelLog:
    """The log with its rows evenly in time, where they come in batches and are stamped on arrival, and a warning.

    A row then is as old as it has waited for its batch, current and reading alike. Where the count of rows keeps step
    with the clock, within what a batch waits and from end to end, that count is the better clock: rows that are lost,
    or a pause, would leave it behind for good.
    """
    time = log.time_s.copy()
    for number in np.unique(log.segment):
        rows = np.flatnonzero(log.segment == number)
        even = _even_clock(time[rows])
        if even is None:
            return log
        time[rows] = even
    late_s = float(np.ptp(time - log.time_s)) if time.size else 0.0
    stated = (
        f"the rows come in batches and are stamped as these arrive, up to {late_s:.2g} s late; their count keeps step "
        "with the clock, so they are taken to be evenly in time"
    )
    return replace(log, time_s=time, warnings=(*log.warnings, stated))


def _even_clock(time_s: Float64Array) -> Float64Array | None:
    """An even clock through stamps (n,) of rows that come in batches; None where they do not, or keep no step."""
    step = np.diff(time_s)
    if step.size < _LEAST_STEPS or float(np.median(step)) >= _IN_BATCHES * float(np.mean(step)):
        return None
    waits = step[step > np.mean(step)]
    if waits.size < _LEAST_BATCHES or float(waits.max()) > _LONGEST_WAIT_S:
        return None
    row = np.arange(time_s.size) - 0.5 * (time_s.size - 1)
    even: Float64Array = time_s.mean() + row * float(row @ time_s) / float(row @ row)
    return even if float(np.ptp(time_s - even)) <= _ON_CLOCK * float(np.quantile(waits, 0.95)) else None


def _mean_step(step_s: Float64Array) -> float:
    """Time per row [s], pauses left out: rows that come in batches have a median step of nothing."""
    running = step_s[step_s <= _PAUSE * step_s.sum()]
    return float(np.mean(running if running.size else step_s)) if step_s.size else math.nan


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
    if _mean_step(step_s) > _SPARSE * period:
        return None
    gaps = step_s[step_s > _GAP * period] / period
    if gaps.size == 0:
        return period
    whole = np.abs(gaps - np.round(gaps)) < _OFF_GRID
    return period if float(np.mean(whole)) >= _ON_GRID else None


def held_readings(log: WheelLog) -> tuple[BoolArray, float | None]:
    """Readings (n,) that a sensor or a register only repeats, and the time from one new reading to the next [s].

    A coarse grid repeats readings too, but then they change by one step of it; a slow sensor's change by many, and
    stand for whole multiples of its refresh: two readings in a row may be alike, and of a wheel that stands many are.
    The refresh is regular in rows, or in time where rows come at any moment. None, and no reading, where that is not
    so.
    """
    speed, n = log.speed_rad_s, len(log)
    good = np.isfinite(speed)
    repeat = np.zeros(n, dtype=bool)
    repeat[1:] = (speed[1:] == speed[:-1]) & (log.segment[1:] == log.segment[:-1])
    new = good & ~repeat
    starts = np.flatnonzero(new)
    none = np.zeros(n, dtype=bool), None
    if starts.size < _LEAST_RUNS or float(np.mean(repeat)) < _HELD_SHARE:
        return none
    change = np.abs(np.diff(speed[starts]))
    change = change[change > 0.0]
    lattice = float(np.quantile(change, 0.02)) if change.size else 0.0
    far = float(np.mean(change > _LATTICE * lattice)) if change.size else 0.0
    if far < _SOME_FAR:
        return none
    step_s = np.diff(log.time_s)[np.diff(log.segment) == 0]
    runs = np.diff(log.segment[starts]) == 0
    rows = np.arange(n, dtype=np.float64)
    in_rows = _Refresh.of(np.diff(rows[starts])[runs], 1.0)
    in_time = _Refresh.of(np.diff(log.time_s[starts])[runs], float(np.quantile(step_s, 0.95)))
    refresh, clock = (in_rows, rows) if in_rows.regular >= in_time.regular else (in_time, log.time_s)
    if far < _FAR and refresh.regular < _ALL_REGULAR:
        return none
    if refresh.regular < _REGULAR or float(np.median(np.diff(starts)[runs])) < 1.0 + _HELD_SHARE:
        return none
    stood = clock - clock[np.maximum.accumulate(np.where(new, np.arange(n), 0))]
    turn = np.floor(stood / refresh.length + _EVEN)
    again = (np.diff(turn, prepend=0.0) > 0.0) & (turn >= _STANDS)
    return repeat & ~again, float(np.diff(log.time_s[starts])[runs].sum() / refresh.multiples.sum())


@dataclass(frozen=True, eq=False)
class _Refresh:
    """The length that runs of repeats are whole multiples of, in rows or in seconds."""

    length: float
    regular: float  # share of the runs that are
    multiples: Float64Array  # of each run

    @classmethod
    def of(cls, run: Float64Array, late: float) -> _Refresh:
        """Of runs (m,); late: by how much a row may see a new reading after it is there."""
        length = float(np.median(run)) if run.size else 0.0
        if not length > 0.0:
            return cls(0.0, 0.0, np.ones(run.size))
        for _ in range(_TURNS):
            multiples = np.maximum(np.round(run / length), 1.0)
            short = multiples < _STANDS
            length = float(run[short].sum() / multiples[short].sum())
        multiples = np.maximum(np.round(run / length), 1.0)
        off = np.abs(run - multiples * length)[multiples < _STANDS]
        return cls(length, float(np.mean(off <= max(late, _ON_TIME * length))), multiples)


def without_repeats(log: WheelLog) -> tuple[WheelLog, Sampling]:
    """The same rows, those that only repeat the reading before without one: they would count it many times over."""
    log = evenly_stamped(log)
    sampling = sampling_of(log)
    return read_anew(log, sampling.held), sampling


def read_anew(log: WheelLog, held: BoolArray) -> WheelLog:
    """The log without the readings (n,) that are held."""
    return replace(log, speed_rad_s=np.where(held, np.nan, log.speed_rad_s)) if held.any() else log
