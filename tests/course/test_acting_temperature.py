"""The temperature that acts behind the one that is read: against the differential equation and its closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rw_ekf.course.acting_temperature import acting_temperature
from rw_ekf.filter.interval_inputs import Gatherer
from rw_ekf.records import WheelSample

TIME = np.arange(0.0, 300.0, 0.5)
ONE = np.zeros(TIME.size, dtype=np.int64)


def test_a_step_is_followed_by_the_exponential() -> None:
    """Three time constants behind a step of 10 K, which comes between two readings, a body has 95 % of it."""
    read = np.where(TIME < 100.0, 20.0, 30.0)
    acts = acting_temperature(TIME, ONE, read, 40.0)
    later = TIME >= 100.0
    assert np.all(acts[~later] == 20.0)
    assert acts[later] == pytest.approx(30.0 - 10.0 * np.exp(-(TIME[later] - 99.75) / 40.0), abs=1e-3)


def test_it_is_the_solution_of_the_equation() -> None:
    """Steps of a millisecond along the differential equation come to the same, for any course of the readings."""
    read = 25.0 + 8.0 * np.sin(TIME / 17.0) + 0.01 * TIME
    body, found = float(read[0]), []
    for reading, following in zip(read.tolist(), [*read[1:].tolist(), 0.0], strict=True):
        found.append(body)
        for step in range(500):
            body += 1.0e-3 * (reading + (following - reading) * (step + 0.5) / 500.0 - body) / 60.0
    assert acting_temperature(TIME, ONE, read, 60.0) == pytest.approx(found, abs=1e-4)


def test_readings_that_come_seldom_are_joined_by_straight_lines() -> None:
    """One in 10 s, or none for a minute: behind the next one the body is where all readings would have had it."""
    read = 25.0 + 8.0 * np.sin(TIME / 60.0)
    seldom = np.where(np.arange(TIME.size) % 20 == 0, read, math.nan)
    seldom[(TIME > 100.0) & (TIME < 160.0)] = math.nan
    whole, found = acting_temperature(TIME, ONE, read, 40.0), acting_temperature(TIME, ONE, seldom, 40.0)
    reported = np.isfinite(seldom)
    assert np.max(np.abs(found - whole)[reported & (TIME < 100.0)]) < 0.02
    assert np.max(np.abs(found - whole)[reported & (TIME > 160.0)]) < 0.5
    assert np.max(np.abs(found - whole)[reported & (TIME > 280.0)]) < 0.03


def test_rows_that_are_lost_leave_the_body_where_it_is() -> None:
    """A gap begins a segment, and the clock goes on: six seconds move a body of 300 s by a fiftieth of the way."""
    read = 20.0 + 0.05 * TIME
    kept = (TIME < 150.0) | (TIME >= 156.0)
    segment = (TIME >= 156.0).astype(np.int64)
    whole = acting_temperature(TIME, ONE, read, 300.0)
    assert acting_temperature(TIME[kept], segment[kept], read[kept], 300.0) == pytest.approx(whole[kept], abs=1e-9)


def test_without_a_lag_it_is_what_was_read_last() -> None:
    """NaN before the first reading, and the last one where one is missing."""
    read = np.array([math.nan, 20.0, math.nan, 21.0])
    found = acting_temperature(np.arange(4.0), np.zeros(4, dtype=np.int64), read, 0.0)
    assert found.tolist()[1:] == [20.0, 20.0, 21.0]
    assert math.isnan(found[0])


def test_a_body_that_is_ahead_comes_back_within_the_lag() -> None:
    """What it was warmer by where the record begins fades with the time constant."""
    acts = acting_temperature(TIME, ONE, np.full(TIME.size, 20.0), 50.0, 3.0)
    assert acts - 20.0 == pytest.approx(3.0 * np.exp(-TIME / 50.0))


def test_the_online_filter_has_the_same() -> None:
    """Sample by sample as over a log, with lost readings, times that go back and a clock that begins anew."""
    rng = np.random.default_rng(5)
    time = np.cumsum(rng.uniform(0.05, 0.2, 400))
    time[50], time[51] = time[49], time[48]
    time[200:] -= time[200]
    segment = (np.arange(400) >= 200).astype(np.int64)
    read = np.where(rng.random(400) < 0.2, math.nan, 20.0 + np.cumsum(rng.standard_normal(400)))
    whole = acting_temperature(time, segment, read, 7.0)
    gatherer, last, part = Gatherer(remembers=False, temperature_lag_s=7.0), -math.inf, -1
    for i in range(400):
        begins = segment[i] != part
        if begins:
            gatherer.restart()
            part = int(segment[i])
        if begins or time[i] > last:
            step = time[i] - last if math.isfinite(last) else 1.0
            gatherer.note(WheelSample(time[i], 0.0, temperature_degC=float(read[i])), 0.0, step)
            last = time[i]
        if not math.isnan(whole[i]):
            assert gatherer.conditions.temperature_degC == pytest.approx(whole[i], abs=1e-12)
