"""A wheel that turns at one speed, or stands, for days: what is learned is there, and nothing grows for ever."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.filter import gating
from rw_ekf.filter.belief import DEFAULT_PRIOR, Belief
from rw_ekf.filter.constants import filter_constants
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.model.state import CK13_STATISTICAL, COULOMB, MOTOR_GAIN, PARAMETERS
from rw_ekf.units import RAD_S_PER_RPM
from tests.filter.replay import Columns, compiled, online
from tests.karnopp import holding_current_A, karnopp
from tests.truth import run_of
from tools.measure.runs import OMEGA_S, constants_for, prior_drawn_around

DAY_S = 86_400.0
TRUE = np.array(CK13_STATISTICAL)


def still_day(speed_rpm: float, seed: int, rate_hz: float, noise_rpm: float = 1.0) -> Columns:
    """A day at the current that holds a speed; torque noise of 0.003 rpm per sqrt(s) moves it a little."""
    speed = speed_rpm * RAD_S_PER_RPM
    rng = np.random.default_rng([seed, 41])
    time_s = np.arange(int(DAY_S * rate_hz)) / rate_hz
    current = np.full(time_s.size, holding_current_A(CK13_STATISTICAL, speed) if speed else 0.0)
    kicks = 0.003 * RAD_S_PER_RPM / np.sqrt(rate_hz) * rng.standard_normal(time_s.size)
    true = karnopp(
        CK13_STATISTICAL, time_s, current, initial_speed_rad_s=speed, kicks_rad_s=kicks, step_s=0.5 / rate_hz
    )
    return Columns(time_s, true + noise_rpm * RAD_S_PER_RPM * rng.standard_normal(time_s.size), current)


def reversing(initial_speed_rad_s: float, seed: int) -> Columns:
    """Ten minutes that show every parameter: braked hard, then sines through zero."""
    time_s = np.linspace(0.0, 599.9, 6000)
    current = np.where(time_s < 60.0, -np.sign(initial_speed_rad_s) * 0.15, 0.12 * np.sin(2.0 * np.pi * time_s / 60.0))
    true = karnopp(CK13_STATISTICAL, time_s, current, initial_speed_rad_s=initial_speed_rad_s)
    return Columns(time_s, true + RAD_S_PER_RPM * np.random.default_rng([seed, 42]).standard_normal(6000), current)


def nees(belief: FilterRun | Belief) -> float:
    """Of the four parameters against the truth; 4 is ideal."""
    error = belief.mean[PARAMETERS] - TRUE
    return float(error @ np.linalg.solve(belief.covariance[PARAMETERS, PARAMETERS], error))


def smallest_correlation_eigenvalue(covariance: Float64Array) -> float:
    """Of the parameters' correlations: above zero where P is positive definite, however unlike its variances."""
    std = np.sqrt(np.diag(covariance))[PARAMETERS]
    return float(np.linalg.eigvalsh(covariance[PARAMETERS, PARAMETERS] / np.outer(std, std))[0])


@pytest.mark.parametrize("rate_hz", [2.0, 10.0])
@pytest.mark.parametrize("speed_rpm", [30.0, 500.0, -3000.0])
@pytest.mark.parametrize("learned", [False, True])
def test_a_day_at_one_speed_teaches_what_it_shows_and_no_more(speed_rpm: float, rate_hz: float, learned: bool) -> None:
    """From a wide prior and a learned belief: truth inside the sigmas after a day and after ten minutes' reversals.

    One combination of k, b and c is seen at a constant speed; before the filter was linearised about a still
    reference the viscous friction was wrong by 26 sigma after this day, and the reversals after it were refused.
    """
    for seed in range(2):
        prior = prior_drawn_around(CK13_STATISTICAL, seed)
        if learned:
            run = filter_log(run_of("P1", seed).course, constants_for(), prior.mean, prior.covariance)
            prior = Belief(run.mean, run.covariance)
        day = compiled(still_day(speed_rpm, seed, rate_hz), constants_for(), prior)
        assert nees(day) < 16.0
        assert smallest_correlation_eigenvalue(day.covariance) > 1e-8
        assert np.count_nonzero(day.outcome != gating.UPDATED) < 4e-4 * day.outcome.size
        after = compiled(reversing(speed_rpm * RAD_S_PER_RPM, seed), constants_for(), Belief(day.mean, day.covariance))
        assert nees(after) < 16.0
        assert np.count_nonzero(after.outcome == gating.GATED) < 60


@pytest.mark.slow
@pytest.mark.parametrize("noise_rpm", [1.0, 5.0])
def test_thirty_days_at_one_speed(noise_rpm: float) -> None:
    """A month in one run, as a daemon has it: sigmas neither collapse nor grow, and the truth stays inside them."""
    prior, constants = prior_drawn_around(CK13_STATISTICAL, 3), constants_for(noise_rpm)
    days = [still_day(500.0, seed, 2.0, noise_rpm) for seed in range(30)]
    month = Columns(
        np.concatenate([day.time_s + i * DAY_S for i, day in enumerate(days)]),
        np.concatenate([day.speed_rad_s for day in days]),
        np.concatenate([day.current_A for day in days]),
    )
    run = compiled(month, constants, prior)
    assert nees(run) < 16.0
    last = run.stds[-1, PARAMETERS]
    first_day = run.stds[int(DAY_S * 2.0), PARAMETERS]
    assert (last < 1.05 * np.sqrt(1.25) * prior.std[PARAMETERS]).all()
    assert (last > 0.8 * first_day).all()
    after = compiled(reversing(500.0 * RAD_S_PER_RPM, 1), constants_for(), Belief(run.mean, run.covariance))
    assert nees(after) < 16.0


def test_online_and_compiled_agree_where_the_speed_is_still() -> None:
    """Minutes at one speed, a gap and missing readings in it, another speed, then motion: every number agrees."""
    rng = np.random.default_rng(7)
    time_s = np.linspace(0.0, 1499.9, 15_000)
    fast, slow = (holding_current_A(CK13_STATISTICAL, rpm * RAD_S_PER_RPM) for rpm in (500.0, 60.0))
    current = np.where(time_s < 700.0, fast, np.where(time_s < 1300.0, slow, -0.1))
    current[7000:7500] = -0.02
    true = karnopp(CK13_STATISTICAL, time_s, current, initial_speed_rad_s=500.0 * RAD_S_PER_RPM)
    reading = true + RAD_S_PER_RPM * rng.standard_normal(time_s.size)
    reading[rng.choice(time_s.size, 3000, replace=False)] = np.nan
    time_s[4000:] += 6.0
    log = Columns(time_s, reading, current)
    constants = constants_for()
    _, results = online(log, constants, DEFAULT_PRIOR)
    run = compiled(log, constants, DEFAULT_PRIOR)
    means, stds = np.array([r.values for r in results]), np.array([r.stds for r in results])
    assert np.max(np.abs(means - run.states) / run.stds) < 1e-6
    assert np.max(np.abs(stds / run.stds - 1.0)) < 1e-6


@pytest.mark.parametrize("drift", [0.001, 0.1])
def test_variances_stop_growing_while_the_wheel_stands(drift: float) -> None:
    """Fifty years at rest, one reading a day: never beyond 1.3 times the prior's variance, P positive definite."""
    constants = filter_constants(OMEGA_S, parameter_drift=drift)
    n = 18_000
    nothing = np.zeros(n)
    days = np.linspace(0.0, DAY_S * (n - 1), n)
    log = Columns(days, 1e-3 * np.random.default_rng(1).standard_normal(n), nothing)
    run = compiled(log, constants, DEFAULT_PRIOR)
    share = run.covariance.diagonal()[PARAMETERS] / DEFAULT_PRIOR.covariance.diagonal()[PARAMETERS]
    assert (share <= 1.3).all()
    assert (share > 1.0).all()
    assert smallest_correlation_eigenvalue(run.covariance) > 1e-3
    _, results = online(
        replace(log, time_s=log.time_s[-400:], speed_rad_s=log.speed_rad_s[-400:], current_A=nothing[:400]),
        constants,
        Belief(run.mean, run.covariance),
    )
    assert results[-1].std.motor_gain <= np.sqrt(1.25) * run.stds[-1, MOTOR_GAIN] * (1.0 + 1e-9)


def test_a_wheel_that_starts_from_long_rest_forgets_nothing() -> None:
    """At rest there is no reference that could shift: the sigma of Coulomb friction rises by drift alone."""
    moving = reversing(0.0, 2)
    rest_s = 300.0
    at_rest = np.linspace(0.0, rest_s - 0.1, 3000)
    noise = RAD_S_PER_RPM * np.random.default_rng(5).standard_normal(3000)
    log = Columns(
        np.concatenate([at_rest, rest_s + moving.time_s]),
        np.concatenate([noise, moving.speed_rad_s]),
        np.concatenate([np.zeros(3000), moving.current_A]),
    )
    std = compiled(log, constants_for(), DEFAULT_PRIOR).stds[:, COULOMB]
    assert (np.diff(std) < 1e-4 * std[:-1]).all()
