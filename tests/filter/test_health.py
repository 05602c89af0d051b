"""A filter that breaks or diverges is found out, reset and named, online and over logs; a healthy one never is."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.filter import gating, health
from rw_ekf.filter.belief import DEFAULT_PRIOR, Belief
from rw_ekf.filter.estimator import Estimator
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.health_monitor import troubles_of
from rw_ekf.filter.smoother import smooth_log
from rw_ekf.model.state import CK13_STATISTICAL, MOTOR_GAIN, PARAMETERS, SPEED, FrictionParameters
from rw_ekf.records import Estimate, FilterReset, FilterTrouble, IssuedCommand, Outcome, WheelSample
from rw_ekf.units import RAD_S_PER_RPM
from tests.filter.replay import OUTCOMES, Columns, compiled, online
from tests.karnopp import karnopp
from tools.measure.runs import constants_for

PERIOD_S = 0.1
TRUE = np.array(CK13_STATISTICAL)


def sines(n: int, bias_A: float = 0.0) -> Float64Array:
    """A current that reverses the wheel every half minute or so."""
    time_s = PERIOD_S * np.arange(n)
    parts = [0.1 * np.sin(2.0 * math.pi * time_s / period + phase) for period, phase in ((40.0, 0.0), (15.0, 1.0))]
    return np.asarray(bias_A + parts[0] + parts[1])


def changing_wheel(
    seed: int, n: int = 12_000, *, friction: float = 1.0, gain: float = 1.0, noise: float = 1.0, viscous: float = 1.0
) -> tuple[Columns, FrictionParameters]:
    """Ten minutes of one wheel, then another of changed parameters or noise under the same currents; its parameters."""
    rng = np.random.default_rng([seed, 91])
    time_s, current = np.linspace(0.0, PERIOD_S * (n - 1), n), sines(n)
    before = CK13_STATISTICAL
    after = FrictionParameters(
        gain * before.motor_gain, viscous * before.viscous, friction * before.coulomb, friction * before.static
    )
    first = karnopp(before, time_s[: n // 2], current[: n // 2])
    second = karnopp(after, time_s[n // 2 :], current[n // 2 :], initial_speed_rad_s=first[-1])
    sigma = np.where(np.arange(n) < n // 2, 1.0, noise) * RAD_S_PER_RPM
    return Columns(time_s, np.concatenate([first, second]) + sigma * rng.standard_normal(n), current), after


def nees(run: FilterRun, truth: FrictionParameters) -> float:
    """Of the four parameters at the end."""
    error = run.mean[PARAMETERS] - np.array(truth)
    return float(error @ np.linalg.solve(run.covariance[PARAMETERS, PARAMETERS], error))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "change",
    [{"friction": 1.5}, {"friction": 0.5}, {"friction": 3.0}, {"gain": 2.0}, {"gain": -1.0}, {"viscous": 10.0}],
)
def test_a_wheel_that_changed_is_learned_anew(seed: int, change: dict[str, float]) -> None:
    """The filter diverges, once, says so, and ten minutes later has the new wheel's parameters within their sigmas."""
    log, truth = changing_wheel(seed, 12_000, **change)
    run = compiled(log, constants_for(), DEFAULT_PRIOR)
    when = np.flatnonzero(run.mended)
    assert troubles_of(run.mended) == [FilterTrouble.DIVERGED]
    assert 6000 < when[0] < 8000
    assert nees(run, truth) < 20.0
    assert np.count_nonzero(run.outcome[-3000:] == gating.GATED) < 30


@pytest.mark.parametrize("noise", [3.0, 5.0, 0.3])
def test_noise_alone_is_no_divergence(noise: float) -> None:
    """Readings that become three or five times as noisy as is believed, or quieter, reset nothing."""
    log, _ = changing_wheel(1, noise=noise)
    assert troubles_of(compiled(log, constants_for(), DEFAULT_PRIOR).mended) == []


def broken(
    log: Columns, at: int, damage: Callable[[Estimator], None], times: int = 1, every: int = 1
) -> tuple[Estimator, list[Estimate]]:
    """The log sample by sample, the estimator damaged before sample `at`, and some times more."""
    constants = constants_for()
    estimator = Estimator(constants, DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
    results = []
    for i in range(log.time_s.size):
        if i >= at and (i - at) % every == 0 and (i - at) // every < times:
            damage(estimator)
        speed = float(log.speed_rad_s[i])
        results.append(estimator.step(WheelSample(float(log.time_s[i]), None if math.isnan(speed) else speed)))
        estimator.command_issued(IssuedCommand(float(log.current_A[i])))
    return estimator, results


def _nan_gain(estimator: Estimator) -> None:
    estimator.ekf.x[MOTOR_GAIN] = math.nan


def _infinite_variance(estimator: Estimator) -> None:
    estimator.ekf.P[SPEED, SPEED] = math.inf


def _negative_variance(estimator: Estimator) -> None:
    estimator.ekf.P[SPEED, SPEED] = -1.0e6


def _impossible_correlation(estimator: Estimator) -> None:
    P = estimator.ekf.P
    P[1, 3] = P[3, 1] = 1.5 * math.sqrt(P[1, 1] * P[3, 3])


def _far_gain(estimator: Estimator) -> None:
    estimator.ekf.x[MOTOR_GAIN] = 1.0e9


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize(
    ("damage", "troubles"),
    [
        (_nan_gain, {FilterTrouble.NOT_FINITE}),
        (_infinite_variance, {FilterTrouble.NOT_FINITE}),
        (_negative_variance, {FilterTrouble.NOT_FINITE, FilterTrouble.NOT_POSITIVE}),
        (_impossible_correlation, {FilterTrouble.NOT_POSITIVE}),
        (_far_gain, {FilterTrouble.RAN_AWAY, FilterTrouble.NOT_FINITE}),
    ],
)
@pytest.mark.parametrize("missing", [False, True])
def test_broken_arithmetic_falls_back_to_the_last_good_belief(
    damage: Callable[[Estimator], None], troubles: set[FilterTrouble], missing: bool
) -> None:
    """Nothing is raised, no estimate after it is NaN, the parameters are those of before, and the run goes on."""
    log, truth = changing_wheel(4, n=6000)
    if missing:
        log.speed_rad_s[3000:3005] = np.nan
    estimator, results = broken(log, 3000, damage)
    reported = [r.health for r in results if r.health is not None]
    assert reported
    assert {h.trouble for h in reported} <= troubles
    first = reported[0]
    assert first.reset is FilterReset.PARAMETERS
    assert not first.beyond_mending
    assert 300.0 <= first.time_s <= 311.0
    at = next(i for i, r in enumerate(results) if r.health is not None)
    assert abs(results[at].state.motor_gain - truth.motor_gain) < 0.1 * truth.motor_gain
    assert all(math.isfinite(v) for r in results[at:] for v in (*r.state, *r.std))
    assert results[-1].health is None
    assert len(estimator.findings) == 1
    assert "reset (1 time)" in estimator.findings[0]
    error = estimator.mean[PARAMETERS] - TRUE
    assert float(error @ np.linalg.solve(estimator.parameter_covariance, error)) < 25.0


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_filter_that_breaks_again_begins_anew_and_is_then_given_up() -> None:
    """The second break within seconds falls back to the start, the fourth is beyond mending, and says so."""
    log, _ = changing_wheel(5, n=6000)
    _, results = broken(log, 3000, _nan_gain, times=5, every=3)
    resets = {r.health.time_s: r.health for r in results if r.health is not None}
    reported = [resets[t] for t in sorted(resets)]
    assert [h.reset for h in reported] == [FilterReset.PARAMETERS, *[FilterReset.ALL] * 4]
    assert [h.beyond_mending for h in reported] == [False, False, False, True, True]
    assert "only a person" in reported[-1].text
    assert results[-1].health is None


@pytest.mark.parametrize("seed", range(3))
def test_readings_that_never_agree_are_told_and_teach_nothing(seed: int) -> None:
    """Two minutes of speeds drawn at random: LOCKED_OUT is told, nothing is reset, and the truth stays."""
    log, _ = changing_wheel(6, n=6000)
    log.speed_rad_s[3000:4200] = np.random.default_rng(seed).uniform(-2000.0, 2000.0, 1200)
    estimator, results = online(log, constants_for(), DEFAULT_PRIOR)
    reported = {(r.health.trouble, r.health.reset) for r in results if r.health is not None}
    assert reported <= {(FilterTrouble.LOCKED_OUT, FilterReset.NOTHING)}
    assert estimator.findings == []
    assert results[-1].health is None
    error = estimator.mean[PARAMETERS] - TRUE
    assert float(error @ np.linalg.solve(estimator.parameter_covariance, error)) < 25.0


def test_a_step_that_no_wheel_can_take_locks_out_until_the_readings_have_agreed_for_long() -> None:
    """The speed jumps by 100 rad/s: refused for ten seconds, then taken, and no parameter has moved; back at once."""
    log, _ = changing_wheel(6, n=6000)
    log.speed_rad_s[3000:3110] += 100.0
    run = compiled(log, constants_for(), DEFAULT_PRIOR)
    assert troubles_of(run.mended) == [FilterTrouble.LOCKED_OUT]
    assert np.count_nonzero(run.outcome[3110:3120] == gating.UPDATED) >= 4
    at = int(np.flatnonzero(run.mended)[0])
    assert 3098 <= at <= 3110
    assert np.array_equal(run.states[at, PARAMETERS], run.states[at - 1, PARAMETERS])
    _, results = online(log, constants_for(), DEFAULT_PRIOR)
    reported = results[at].health
    assert reported is not None
    assert reported.reset is FilterReset.SPEED
    assert results[at].outcome is Outcome.RESEEDED


def test_one_number_repeated_is_not_believed_however_long() -> None:
    """A reading that stays the same while the wheel must move is refused for minutes, is told, and nothing is reset."""
    log, _ = changing_wheel(7, n=6000)
    log.speed_rad_s[3000:5000] = 250.0
    _, results = online(log, constants_for(), DEFAULT_PRIOR)
    reported = {(r.health.trouble, r.health.reset) for r in results if r.health is not None}
    assert reported == {(FilterTrouble.LOCKED_OUT, FilterReset.NOTHING)}
    assert results[-1].health is None
    assert results[-1].outcome is Outcome.UPDATED


def test_a_gain_of_the_wrong_sign_is_unphysical() -> None:
    """Readings of the wrong sign from the start: a negative gain is learned, and told as unphysical."""
    log, _ = changing_wheel(8, n=4000)
    turned = Columns(log.time_s, -log.speed_rad_s, log.current_A)
    _, results = online(turned, constants_for(), Belief(DEFAULT_PRIOR.mean, 4.0 * DEFAULT_PRIOR.covariance))
    last = results[-1].health
    assert last is not None
    assert last.trouble is FilterTrouble.UNPHYSICAL
    assert last.reset is FilterReset.NOTHING
    assert results[-1].state.motor_gain < 0.0


@pytest.mark.parametrize("change", [{"friction": 1.5}, {"gain": -1.0}])
def test_online_and_compiled_reset_at_the_same_sample_to_the_same_belief(change: dict[str, float]) -> None:
    """Every estimate and outcome agrees through a divergence and after it, with readings missing."""
    log, _ = changing_wheel(2, 12_000, **change)
    log.speed_rad_s[np.random.default_rng(3).choice(12_000, 3600, replace=False)] = np.nan
    constants = constants_for()
    estimator, results = online(log, constants, DEFAULT_PRIOR)
    run = compiled(log, constants, DEFAULT_PRIOR)
    assert troubles_of(run.mended) == [FilterTrouble.DIVERGED]
    assert len(estimator.findings) == 1
    assert [r.outcome for r in results] == [OUTCOMES[code] for code in run.outcome]
    means, stds = np.array([r.values for r in results]), np.array([r.stds for r in results])
    assert np.max(np.abs(means - run.states) / run.stds) < 1e-6
    assert np.max(np.abs(stds / run.stds - 1.0)) < 1e-6


def test_the_smoother_does_not_look_back_through_a_reset() -> None:
    """Before the reset it has the old wheel's friction, after it the new one's."""
    log, truth = changing_wheel(3, friction=1.5)
    run = compiled(log, constants_for(), DEFAULT_PRIOR, keep_history=True)
    means, stds = smooth_log(run)
    at = int(np.flatnonzero(run.mended)[0])
    assert np.isfinite(means).all()
    assert np.isfinite(stds).all()
    assert abs(means[5000, 3] - CK13_STATISTICAL.coulomb) < 0.05
    assert abs(means[at + 1, 3] - truth.coulomb) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [2.0, 50.0])
def test_no_reset_in_two_hundred_healthy_hours(rate_hz: float) -> None:
    """Sines, steps, rest and constant speed by turns, outliers alone and in bursts, 30 % of the readings missing.

    A burst that outlasts the gate's patience is a fault, and may be told as such: one in a hundred hours.
    """
    hours = 200.0 if rate_hz < 20.0 else 40.0
    samples, seed, done_h = int(3600.0 * rate_hz), 0, 0.0
    belief, reported = DEFAULT_PRIOR, []
    while done_h < hours:
        rng = np.random.default_rng([seed, 17])
        time_s = np.linspace(0.0, (samples - 1) / rate_hz, samples)
        kind = seed % 4
        if kind == 0:
            current = 0.15 * np.sin(2.0 * math.pi * time_s / rng.uniform(10.0, 300.0)) + rng.uniform(-0.1, 0.1)
        elif kind == 1:
            current = np.repeat(rng.uniform(-0.25, 0.25, 240), samples // 240 + 1)[:samples]
        elif kind == 2:
            current = np.full(samples, rng.uniform(0.05, 0.2) * rng.choice([-1.0, 1.0]))
        else:
            current = np.where(time_s % 600.0 < 300.0, 0.0, 0.1)
        true = karnopp(CK13_STATISTICAL, time_s, current, step_s=min(2e-3, 0.5 / rate_hz))
        reading = true + RAD_S_PER_RPM * rng.standard_normal(samples)
        spikes = rng.choice(samples, samples // 500, replace=False)
        reading[spikes] += rng.normal(0.0, 50.0, spikes.size)
        burst = int(rng.integers(0, samples - 200))
        reading[burst : burst + int(rng.integers(2, int(5 * rate_hz)))] += rng.normal(0.0, 100.0)
        reading[rng.random(samples) < 0.3] = np.nan
        run = compiled(Columns(time_s, reading, current), constants_for(), belief)
        reported += troubles_of(run.mended)
        belief = Belief(run.mean, run.covariance)
        done_h += 1.0
        seed += 1
    assert set(reported) <= {FilterTrouble.LOCKED_OUT}
    assert len(reported) <= 0.02 * hours


def test_frozen_filters_are_never_reset() -> None:
    """A filter that holds its parameters for known keeps them, however wrong they are."""
    log, _ = changing_wheel(2, friction=3.0)
    known = np.zeros((5, 5))
    known[SPEED, SPEED] = 1.0
    run = compiled(log, constants_for()._replace(
        motor_gain_drift=0.0, viscous_drift=0.0, coulomb_drift=0.0, static_drift=0.0
    ), Belief(DEFAULT_PRIOR.mean, known))  # fmt: skip
    assert not run.mended.any()
    assert np.array_equal(run.mean[PARAMETERS], DEFAULT_PRIOR.mean[PARAMETERS])
    assert not health.learns(known)
