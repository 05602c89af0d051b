"""A second pass over a log: no reading counts twice, and break-aways are linearised where the truth lies."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.filter.belief import DEFAULT_PRIOR, Belief
from rw_ekf.filter.constants import filter_constants
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.filter.parameters_held import without_drift
from rw_ekf.filter.second_pass import second_look
from rw_ekf.model.state import PARAMETERS, STATIC
from rw_ekf.units import RAD_S_PER_RPM
from tests.truth import run_of
from tools.measure.runs import prior_drawn_around

STEADY = without_drift(filter_constants(4.0 * RAD_S_PER_RPM, speed_noise_rad_s=RAD_S_PER_RPM, acceleration_noise=0.0))


def filtered(course: Course, prior: Belief = DEFAULT_PRIOR) -> FilterRun:
    return filter_log(course, STEADY, prior.mean, prior.covariance, mends=True)


def looked_at_again(course: Course, prior: Belief, first: FilterRun) -> Belief:
    again = second_look(course, STEADY, prior, Belief(first.mean, first.covariance))
    assert again is not None
    return again[0]


def one_way() -> Course:
    """Five minutes of steps at speeds where friction is linear in everything."""
    time_s = np.arange(0.0, 300.0, 0.1)
    current = np.random.default_rng(5).uniform(0.0, 0.2, 15)[(time_s // 20.0).astype(int)]
    noise = PlantNoise(RAD_S_PER_RPM)
    run = simulate_run(PlantParameters(), current, time_s, noise, seed=5, initial_speed_rad_s=150.0)
    return Course.of(time_s, run.measured_speed_rad_s, current)


def test_no_reading_counts_twice() -> None:
    """Where the wheel never comes near rest a second pass ends where the first did, sigmas and all."""
    course = one_way()
    first = filtered(course)
    again = looked_at_again(course, DEFAULT_PRIOR, first)
    std = np.sqrt(np.diag(first.covariance))
    assert np.any(again.mean != first.mean)
    np.testing.assert_allclose(again.mean / std, first.mean / std, atol=0.05)
    np.testing.assert_allclose(again.std, std, rtol=0.01)
    assert again.std[STATIC] == pytest.approx(std[STATIC])  # which is the prior's, given Coulomb friction


def test_a_second_pass_knows_break_away_friction_better_and_says_so() -> None:
    """S3, ten wheels, vague priors: sigmas of T_s shrink by a third in the middle, and hold the truth all the same."""
    shrunk: list[float] = []
    normalised: list[Float64Array] = []
    for seed in range(10):
        run = run_of("S3", seed)
        prior = prior_drawn_around(run.parameters, seed)
        first = filtered(run.course, prior)
        again = looked_at_again(run.course, prior, first)
        shrunk.append(again.std[STATIC] / float(np.sqrt(first.covariance[STATIC, STATIC])))
        normalised.append((again.mean[PARAMETERS] - np.array(run.parameters)) / again.std[PARAMETERS])
    assert np.median(shrunk) < 0.75
    assert float(np.abs(normalised).max()) < 3.0
    assert float(np.sqrt(np.mean(np.square(normalised)))) < 1.2
