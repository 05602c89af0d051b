"""What an interval between two readings is made of, as the online filter gathers it: currents and conditions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

from rw_ekf.arrays import Float64Array
from rw_ekf.course.current_schedule import CurrentSchedule, GivenCurrents, pieces_between
from rw_ekf.model.friction import Stribeck
from rw_ekf.model.law import MOST_COLUMNS
from rw_ekf.records import Conditions, WheelSample
from rw_ekf.wheel.effect_table import EffectTable
from rw_ekf.wheel.interval import UNREAD, Interval, Pieces, warmed
from rw_ekf.wheel.outlook import WheelOutlook

_REMEMBERED_S = 10.0  # of past commands, for a model with a delay or a window


class Surroundings(NamedTuple):
    """One interval and the pieces of current that its indices mean."""

    interval: Interval
    pieces: Pieces


class Given(NamedTuple):
    """What is known at a sample of what follows it, as it is before a command is issued."""

    conditions: Conditions
    currents: GivenCurrents
    past: tuple[tuple[float, float, float], ...]  # begin [s], duration [s], current [A] of remembered pieces


def outlook(
    x: Float64Array, table: EffectTable, stribeck: Stribeck, given: Given, time_s: float,
    speed_rad_s: float | None = None,
) -> WheelOutlook:  # fmt: skip
    """The wheel after a sample at time_s [s], from when a command acts that is as late as the last one was.

    x (n,): belief. speed_rad_s: a speed to take for known in place of the believed one.
    """
    to_s = time_s + given.currents.delay_s
    durations, currents = pieces_between(given.currents.in_force_A, given.currents.pending, time_s, to_s)
    begins = accumulate(durations[:-1], initial=time_s)
    rows = [*given.past, *zip(begins, durations, currents, strict=True)]  # past ones only where the model looks back
    warmth, angle, columns = given.conditions
    interval = Interval(time_s, to_s, warmth, angle, 0, len(given.past), len(rows), columns)
    pieces = Pieces(*(list(column) for column in zip(*rows, strict=True)))
    return WheelOutlook(x, table, stribeck, interval, pieces, speed_rad_s)


class Gatherer:
    """Collects, sample by sample, what the compiled pass over a log reads from its columns."""

    def __init__(self, *, remembers: bool, columns: Sequence[str] = (), temperature_lag_s: float = 0.0) -> None:
        """remembers: keep past pieces of current, which only a delay and a window look back at.

        columns: of samples, that learned laws are functions of. temperature_lag_s: of what acts behind what is read.
        """
        self.schedule = CurrentSchedule()
        self.angle_rad = 0.0
        self._remembers = remembers
        self._names = columns
        self._columns = [math.nan] * MOST_COLUMNS
        self._body = UNREAD
        self._lag_s = temperature_lag_s
        self._past: list[tuple[float, float, float]] = []

    @property
    def conditions(self) -> Conditions:
        """At the last sample."""
        first, second, third = self._columns
        return Conditions(self._body.acts, self.angle_rad, (first, second, third))

    def current_A(self, time_s: float) -> float:
        """In force at a time up to that of the last sample, as far back as is remembered."""
        for begin_s, duration_s, current_A in reversed(self._past):
            if time_s >= begin_s + duration_s:
                break
            if time_s >= begin_s:
                return current_A
        return self.schedule.in_force_A

    @property
    def given(self) -> Given:
        """What is known of what follows the last sample."""
        return Given(self.conditions, self.schedule.given, tuple(self._past) if self._remembers else ())

    def restart(self) -> Surroundings:
        """Forget the currents: a new segment, whose clock says nothing about the old one's, and no interval before."""
        self.schedule.restart()
        self._past.clear()
        warmth, angle, columns = self.conditions
        return Surroundings(Interval(0.0, 0.0, warmth, angle, 0, 0, 0, columns), Pieces([], [], []))

    def interval(self, from_s: float, to_s: float) -> Surroundings:
        """Describe the interval; commands that came to act within it are used up."""
        durations, currents = self.schedule.pieces(from_s, to_s)
        begins = []
        at = from_s
        for duration in durations:
            begins.append(at)
            at += duration
        past = self._past
        found = Surroundings(
            Interval(
                from_s=from_s,
                to_s=to_s,
                temperature_degC=self._body.acts,
                angle_rad=self.angle_rad,
                first=0,
                start=len(past),
                stop=len(past) + len(durations),
                columns=self.conditions.columns,
            ),
            Pieces(
                [piece[0] for piece in past] + begins,
                [piece[1] for piece in past] + durations,
                [piece[2] for piece in past] + currents,
            ),
        )
        if self._remembers:
            self._past += zip(begins, durations, currents, strict=True)
            while len(self._past) > 1 and self._past[1][0] < to_s - _REMEMBERED_S:
                del self._past[0]
        return found

    def note(self, sample: WheelSample, mean_speed_rad_s: float, dt: float) -> None:
        """Note the conditions at a sample: logged, or the angle from the mean speed since the one before."""
        turned = mean_speed_rad_s * dt
        if math.isfinite(turned):  # not while the filter is broken: no effect of the angle would recover with it
            self.angle_rad += turned
        if sample.angle_rad is not None and math.isfinite(sample.angle_rad):
            self.angle_rad = sample.angle_rad
        now_degC = math.nan if sample.temperature_degC is None else sample.temperature_degC
        self._body = warmed(self._body, now_degC, dt, self._lag_s)
        for slot, name in enumerate(self._names):
            value = getattr(sample, name, None)
            if value is not None and math.isfinite(value):
                self._columns[slot] = value
