"""What becomes of each kind of sample, by name, and what the filter refuses."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.errors import FilterError
from rw_ekf.filter.belief import DEFAULT_PRIOR, Belief
from rw_ekf.filter.ekf import WheelEkf
from rw_ekf.filter.estimator import Estimator
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.records import Estimate, IssuedCommand, Outcome, WheelSample
from tools.measure.runs import constants_for

SPEED = 50.0


def estimator_at(speed_rad_s: float = SPEED, samples: int = 30) -> tuple[Estimator, Callable[..., Estimate]]:
    """An estimator fed with a steady speed, and a function that feeds it the sample a given time after the last."""
    estimator = Estimator(constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
    now = 0.0

    def feed(speed: float | None, after_s: float = 0.1, segment: int = 0) -> Estimate:
        nonlocal now
        result = estimator.step(WheelSample(now + after_s, speed, segment=segment))
        if result.outcome not in {Outcome.BACKWARD, Outcome.REPEATED}:
            now += after_s
        # The current that keeps the believed wheel at a steady speed.
        k, b, c, _ = estimator.parameters
        estimator.command_issued(IssuedCommand((b * speed_rad_s + c) / k))
        return result

    for _ in range(samples):
        feed(speed_rad_s)
    return estimator, feed


def test_the_first_reading_seeds_the_speed() -> None:
    """The first reading becomes the speed, with the reading's own sigma, and is compared with nothing."""
    estimator = Estimator(constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
    result = estimator.step(WheelSample(5.0, 12.0))
    assert result.outcome is Outcome.FIRST
    assert result.state.speed_rad_s == 12.0
    assert result.std.speed_rad_s == pytest.approx(math.sqrt(constants_for().speed_variance))
    assert result.innovation is None


def test_a_good_reading_updates() -> None:
    """A reading near the prediction is used and its innovation is accepted."""
    _, feed = estimator_at()
    result = feed(SPEED)
    assert result.outcome is Outcome.UPDATED
    assert result.innovation is not None
    assert result.innovation.accepted
    assert result.innovation.reason is None


def test_a_missing_reading_leaves_no_innovation() -> None:
    """Without a speed the filter predicts, its speed sigma grows, and no stale innovation is shown."""
    estimator, feed = estimator_at()
    before = estimator.covariance[0, 0]
    result = feed(None)
    assert result.outcome is Outcome.MISSING
    assert result.innovation is None
    assert estimator.covariance[0, 0] > before
    assert feed(float("nan")).outcome is Outcome.MISSING
    assert feed(SPEED).outcome is Outcome.UPDATED


def test_a_repeated_sample_changes_nothing() -> None:
    """The same time again is skipped: the belief stays to the last bit."""
    estimator, feed = estimator_at()
    mean, covariance = estimator.mean, estimator.covariance
    result = feed(SPEED + 3.0, 0.0)
    assert result.outcome is Outcome.REPEATED
    assert (estimator.mean == mean).all()
    assert (estimator.covariance == covariance).all()


def test_a_backward_sample_changes_nothing() -> None:
    """A time before the last one's is skipped, and the next sample goes on from the last good one."""
    estimator, feed = estimator_at()
    mean = estimator.mean
    assert feed(SPEED + 3.0, -0.25).outcome is Outcome.BACKWARD
    assert (estimator.mean == mean).all()
    assert feed(SPEED, 0.1).outcome is Outcome.UPDATED


def test_a_gap_reseeds_the_speed_and_keeps_the_parameters() -> None:
    """After a gap the speed starts afresh from the reading; parameters keep value and sigma (but for their drift)."""
    estimator, feed = estimator_at()
    parameters, spread = estimator.mean[1:], np.sqrt(np.diag(estimator.covariance))[1:]
    result = feed(-120.0, 30.0)
    assert result.outcome is Outcome.RESEEDED
    assert result.state.speed_rad_s == -120.0
    assert (estimator.mean[1:] == parameters).all()
    np.testing.assert_allclose(np.sqrt(np.diag(estimator.covariance))[1:], spread, rtol=1e-3)
    assert (estimator.covariance[0, 1:] == 0.0).all()


def test_a_gap_that_ends_blind_waits_for_a_reading() -> None:
    """Where the sample after a gap has no speed, the next that has one re-seeds."""
    _, feed = estimator_at()
    assert feed(None, 30.0).outcome is Outcome.MISSING
    assert feed(None).outcome is Outcome.MISSING
    result = feed(77.0)
    assert result.outcome is Outcome.RESEEDED
    assert result.state.speed_rad_s == 77.0


def test_a_new_segment_reseeds_even_where_time_runs_back() -> None:
    """A new segment's clock says nothing about the old one's: no BACKWARD, speed re-seeded, parameters kept."""
    estimator, feed = estimator_at()
    parameters = estimator.mean[1:]
    result = feed(10.0, -2.9, segment=1)
    assert result.outcome is Outcome.RESEEDED
    assert result.state.speed_rad_s == 10.0
    assert (estimator.mean[1:] == parameters).all()


def test_a_spike_is_gated_and_its_innovation_kept() -> None:
    """A reading far outside is not used; its innovation and nis are shown, and the next good reading is used again."""
    estimator, feed = estimator_at()
    before = estimator.mean
    result = feed(SPEED + 20.0)
    assert result.outcome is Outcome.GATED
    assert result.innovation is not None
    assert not result.innovation.accepted
    assert result.innovation.reason == "gate"
    assert result.innovation.nis > result.innovation.gate
    assert result.innovation.innovation_rad_s == pytest.approx(20.0, abs=0.2)
    assert abs(estimator.mean[0] - before[0]) < 0.2
    assert (estimator.mean[1:] == before[1:]).all()
    assert feed(SPEED).outcome is Outcome.UPDATED


def test_five_gated_samples_in_a_row_reseed() -> None:
    """When the gate refuses five running that a wheel can have, the fifth re-seeds and keeps its nis."""
    _, feed = estimator_at()
    readings = [SPEED + 2.0 + 0.01 * i for i in range(6)]
    outcomes = [feed(reading).outcome for reading in readings[:4]]
    assert outcomes == [Outcome.GATED] * 4
    fifth = feed(readings[4])
    assert fifth.outcome is Outcome.RESEEDED
    assert fifth.state.speed_rad_s == readings[4]
    assert fifth.innovation is not None
    assert not fifth.innovation.accepted
    assert fifth.innovation.reason == "reseeded"
    assert feed(readings[5]).outcome is Outcome.UPDATED


def test_a_step_that_no_wheel_can_take_needs_a_far_longer_agreement() -> None:
    """After a step of 20 rad/s in a period the speed waits for a hundred readings over ten seconds, then follows."""
    estimator, feed = estimator_at()
    parameters = estimator.mean[1:]
    outcomes = [feed(SPEED + 20.0 + 0.01 * (i % 7)).outcome for i in range(102)]
    assert outcomes[:99] == [Outcome.GATED] * 99
    assert outcomes.count(Outcome.RESEEDED) == 1
    at = outcomes.index(Outcome.RESEEDED)
    assert set(outcomes[at + 1 :]) <= {Outcome.UPDATED}
    np.testing.assert_allclose(estimator.mean[1:], parameters, rtol=0.05)


@pytest.mark.parametrize("wild", ["one number", "ends by turns", "anything"])
def test_readings_that_do_not_agree_never_reseed(wild: str) -> None:
    """One number repeated, the register's ends by turns, or any numbers, 300 long: gated, and the parameters stay."""
    estimator, feed = estimator_at()
    rng = np.random.default_rng(3)
    parameters = estimator.mean[1:]
    for i in range(300):
        wrong = {
            "one number": 290.0,
            "ends by turns": 1715.6 * (-1.0) ** i,
            "anything": float(rng.uniform(-500.0, 500.0)),
        }[wild]
        assert feed(wrong).outcome is Outcome.GATED
    assert (estimator.mean[1:] == parameters).all()


def test_a_wheel_at_rest_may_repeat_itself() -> None:
    """Zero, read again and again where the filter believed in motion, re-seeds: a wheel at rest reads the same."""
    _, feed = estimator_at(1.5)
    outcomes = [feed(0.0).outcome for _ in range(5)]
    assert outcomes[0] is Outcome.GATED
    assert outcomes[-1] is Outcome.RESEEDED


def test_a_wild_first_reading_is_outvoted_by_the_five_that_follow() -> None:
    """A speed that nothing confirmed has no more standing than the readings that contradict it."""
    estimator = Estimator(constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
    assert estimator.step(WheelSample(0.0, 300.0)).outcome is Outcome.FIRST
    readings = [SPEED - 0.06 * i for i in range(1, 6)]
    outcomes = [estimator.step(WheelSample(0.1 * i, w)).outcome for i, w in enumerate(readings, start=1)]
    assert outcomes == [Outcome.GATED] * 4 + [Outcome.RESEEDED]


def test_four_gated_samples_then_a_good_one_start_the_count_afresh() -> None:
    """An accepted sample clears the count of gated ones."""
    _, feed = estimator_at()
    for _ in range(2):
        for i in range(4):
            assert feed(SPEED + 2.0 + 0.01 * i).outcome is Outcome.GATED
        assert feed(SPEED).outcome is Outcome.UPDATED


@pytest.mark.parametrize("bad", [math.inf, -math.inf])
def test_an_infinite_reading_is_refused_by_name(bad: float) -> None:
    """Infinity is not a reading: FilterError, and the belief is as it was before."""
    estimator, feed = estimator_at()
    with pytest.raises(FilterError, match="inf"):
        feed(bad)
    assert np.isfinite(estimator.mean).all()


@pytest.mark.parametrize("current_A", [math.nan, math.inf])
def test_a_current_that_is_no_number_is_refused_by_name(current_A: float) -> None:
    """A current that is not finite stops at the door; inside, a wheel driven by NaN would quietly stand still."""
    estimator, feed = estimator_at()
    with pytest.raises(FilterError, match="current"):
        estimator.command_issued(IssuedCommand(current_A))
    assert feed(SPEED).outcome is Outcome.UPDATED


def test_a_log_with_an_infinite_current_is_refused_by_name() -> None:
    """The compiled pass says so too, instead of taking the wheel for one that stands still."""
    time_s, current = np.linspace(0.0, 4.9, 50), np.full(50, 0.1)
    current[20] = np.inf
    course = Course.of(time_s, np.full(50, SPEED), current)
    with pytest.raises(FilterError, match="finite"):
        filter_log(course, constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)


@pytest.mark.parametrize(
    ("mean", "covariance"),
    [
        (np.zeros(4), np.eye(5)),
        (np.zeros((5, 1)), np.eye(5)),
        (np.zeros(5), np.eye(4)),
        (np.full(5, np.nan), np.eye(5)),
        (np.zeros(5), np.full((5, 5), np.inf)),
        (np.zeros(5), -np.eye(5)),
        (np.zeros(5), np.triu(np.ones((5, 5)))),
    ],
)
def test_a_belief_that_is_none_is_refused(mean: Float64Array, covariance: Float64Array) -> None:
    """Wrong shapes, non-numbers, negative variances and asymmetry never get past the door."""
    with pytest.raises(FilterError):
        WheelEkf(constants_for(), mean, covariance)


def test_frozen_parameters_stay_frozen() -> None:
    """A parameter with no variance and no drift keeps its value to the last bit, through zero speed as well."""
    covariance = np.diag([1.0, 4.0, 0.0, 0.0, 0.0])
    belief = Belief(DEFAULT_PRIOR.mean.copy(), covariance)
    constants = constants_for()._replace(viscous_drift=0.0, coulomb_drift=0.0, static_drift=0.0)
    time_s = np.linspace(0.0, 59.9, 600)
    speed = 5.0 * np.sin(0.3 * time_s)
    course = Course.of(time_s, speed, 0.1 * np.cos(0.3 * time_s))
    run = filter_log(course, constants._replace(gate=1e9), belief.mean, belief.covariance)
    assert (run.mean[2:] == belief.mean[2:]).all()
    assert (run.covariance[2:] == 0.0).all()
