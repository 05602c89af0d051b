"""The stamps of records: UTC by the wheel's clock, whatever delays a turn on its way to a recorder."""

from __future__ import annotations

from datetime import UTC, datetime
from itertools import pairwise

import numpy as np

from rw_ekf.clock import VirtualClock
from rw_ekf.sinks.recorders.tick_record import TickRecords
from tests.recorders.ticks import TRACKING, turn
from tests.ticks import STATE

BEGAN = datetime(2026, 3, 1, tzinfo=UTC)


def test_a_turn_that_comes_late_has_the_stamp_of_its_reading() -> None:
    """Delays of 0 to 0.3 s and one of 20 s, a wheel's clock that is 200 ppm slow, for ten minutes: 30 ms at most."""
    clock, rng = VirtualClock(BEGAN), np.random.default_rng(3)
    records = TickRecords(clock, TRACKING, STATE._fields)
    errors, stamps = [], []
    for i in range(6000):
        true_s = 0.1 * i * 1.0002
        delay_s = 20.0 - 0.1 * (i - 3000) if 3000 <= i < 3200 else rng.uniform(0.0, 0.3) * (i % 7 > 0)
        clock.sleep(max(true_s + delay_s - clock.monotonic(), 0.0))
        stamps.append(records.of(turn(i)).stamp_ns)
        errors.append(stamps[-1] * 1e-9 - BEGAN.timestamp() - true_s)
    assert max(map(abs, errors[7:])) < 0.03  # two minutes and the 20 s at 200 ppm: 28 ms
    assert all(later > sooner for sooner, later in pairwise(stamps))


def test_a_wheel_that_starts_again_from_zero_keeps_its_stamps() -> None:
    """Where a segment begins the wheel's clock may be any."""
    from dataclasses import replace

    clock = VirtualClock(BEGAN)
    records = TickRecords(clock, TRACKING, STATE._fields)
    for i in range(20):
        tick = turn(i) if i < 10 else turn(i - 1000)
        tick = replace(tick, sample=replace(tick.sample, segment=i // 10))
        assert records.of(tick).stamp_ns == round((BEGAN.timestamp() + 0.1 * i) * 1e9)
        clock.sleep(0.1)
