"""What the watch reads from the loop's stream."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.filter.estimator import Estimator
from rw_ekf.records import Estimate, Innovation, IssuedCommand, Outcome, Tick, WheelSample, WheelState
from rw_ekf.watch.observation import Observation, ObservationReader
from tools.measure.watch_runs import OMEGA_S, commands, drawn_wheel, filtered, simulated, stream

R = 0.01
MEAN = WheelState(10.0, 15.0, 0.003, 0.6, 0.62)


def estimate(time_s: float, outcome: Outcome = Outcome.UPDATED, innovation: float | None = 0.1) -> Estimate:
    test = None
    if innovation is not None:
        test = Innovation(time_s, innovation, 0.11, 0.0, 15.0, outcome is Outcome.UPDATED)
    return Estimate(time_s, outcome, MEAN, WheelState(*(0.1,) * 5), test, 10.0)


def read_all(*ticks: Tick) -> list[Observation | None]:
    reader = ObservationReader(R, 0.1, OMEGA_S)
    return [reader.read(tick) for tick in ticks]


def ordinary(index: int, **changes: float) -> Tick:
    time_s = changes.pop("time_s", 0.1 * index)
    return Tick(WheelSample(time_s, 10.0), estimate(time_s), IssuedCommand(0.1, 0.02))


def test_the_fast_stream_is_the_daemon_s() -> None:
    """Observations by the compiled pass and by the online estimator agree, so that the tests below judge the daemon."""
    time_s, current_A = commands("P2", 0.02, 3)
    run = simulated(drawn_wheel(3), time_s, current_A, 3)
    run.measured_speed_rad_s[300:303] = np.nan
    run.measured_speed_rad_s[400] += 5.0
    constants, done = filtered(run)
    estimator = Estimator(constants, DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
    readers = [ObservationReader(constants.speed_variance, 0.1, OMEGA_S) for _ in range(2)]
    for fast in stream(run, constants, done):
        online = replace(fast, estimate=estimator.step(fast.sample))
        assert fast.command is not None
        estimator.command_issued(fast.command)
        a, b = readers[0].read(online), readers[1].read(fast)
        assert a is not None
        assert b is not None
        assert np.allclose(np.array(a[:10]), np.array(b[:10]), rtol=1e-6, atol=1e-9, equal_nan=True)
        assert a[11] == pytest.approx(b[11], rel=1e-6)
        assert a[12:] == b[12:]


def test_gain_and_current_are_those_of_the_interval() -> None:
    """The gain is 1 - R/S of a used reading; the current is the mean of the old and the new command's shares."""
    _, _, third = read_all(ordinary(0), ordinary(1), ordinary(2))
    assert third is not None
    assert third.gain == pytest.approx(1.0 - R / 0.11**2)
    assert third.current_A == pytest.approx(0.1)
    _, second = read_all(ordinary(0), ordinary(1))
    assert second is not None
    assert second.current_A == pytest.approx(0.8 * 0.1)
    assert second.direction == 1.0


def test_a_reading_that_was_not_used_has_no_gain_but_its_innovation() -> None:
    """A gated reading is observed though the filter did not take it."""
    gated = replace(ordinary(1), estimate=estimate(0.1, Outcome.GATED, 0.9))
    _, second = read_all(ordinary(0), gated)
    assert second is not None
    assert second.gain == 0.0
    assert second.innovation_rad_s == 0.9
    assert not second.restart


def test_gaps_segments_and_reseeding_begin_anew() -> None:
    """First sample, gap, new segment and a speed seeded after a gap are restarts; a missing reading is none."""
    late = ordinary(1, time_s=0.9)
    assert [e.restart for e in read_all(ordinary(0), late) if e is not None] == [True, True]
    second = ordinary(1)
    segment = replace(second, sample=replace(second.sample, segment=1))
    assert [e.restart for e in read_all(ordinary(0), segment) if e is not None] == [True, True]
    seeded = replace(second, estimate=estimate(0.1, Outcome.RESEEDED, None))
    assert [e.restart for e in read_all(ordinary(0), seeded) if e is not None] == [True, True]
    missing = Tick(replace(second.sample, speed_rad_s=None), estimate(0.1, Outcome.MISSING, None), second.command)
    _, reported = read_all(ordinary(0), missing)
    assert reported is not None
    assert not reported.restart
    assert math.isnan(reported.innovation_rad_s)


def test_time_that_does_not_move_on_is_no_observation() -> None:
    """Repeated and backward samples are skipped."""
    for outcome in (Outcome.REPEATED, Outcome.BACKWARD):
        assert read_all(ordinary(0), replace(ordinary(1), estimate=estimate(0.1, outcome, None)))[1] is None


def test_what_tells_nothing_of_drag_has_no_direction() -> None:
    """No direction at rest, over a reversal, under a command nobody confirmed, and in creep just above break-away."""
    first, after = ordinary(0), ordinary(1)

    def predicting(speed_rad_s: float) -> Tick:
        return replace(after, estimate=replace(after.estimate, predicted_speed_rad_s=speed_rad_s))

    doubtful = replace(first, command=IssuedCommand(0.1, 0.02, acknowledged=False))
    slow = replace(first.estimate, state=MEAN._replace(speed_rad_s=0.5))
    creeping = replace(first, command=IssuedCommand(0.045), estimate=slow)
    for before, then in (
        (first, predicting(0.0)),
        (first, predicting(-3.0)),
        (doubtful, after),
        (creeping, predicting(0.5)),
    ):
        _, second = read_all(before, then)
        assert second is not None
        assert second.direction == 0.0
