"""Can the error bars be believed? Monte Carlo against a fine-step truth that shares no code with the filter.

NEES is the squared error of the four parameters in the metric of their covariance: 4 on average if the covariance is
right, less if it is cautious. The filter keeps its default process noise, which the truth does not have.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pytest
from scipy.stats import truncnorm

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.filter.belief import DEFAULT_PRIOR, Belief
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.model.friction import Stribeck
from rw_ekf.model.state import CK13_STATISTICAL, FrictionParameters
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.interval import Pieces
from rw_ekf.wheel.transition import factor_covariance, transition
from tests.truth import cramer_rao_std_fine, fine_trajectory, run_of
from tools.measure.runs import OMEGA_S, PUBLISHED, constants_for, cramer_rao_std, prior_drawn_around

pytestmark = pytest.mark.xdist_group("monte carlo")  # runs are filtered once

RUNS = 24


@dataclass(frozen=True)
class MonteCarlo:
    """What RUNS runs of one profile at 1 rpm gave."""

    nees: Float64Array  # (RUNS,)
    errors: Float64Array  # (RUNS, 4)
    bounds: Float64Array  # (RUNS, 4) Cramer-Rao
    low_speed_mse: Float64Array  # (RUNS,) of the true speed below 100 rpm [rad^2/s^2]
    nis: Float64Array  # (RUNS,)


@lru_cache
def monte_carlo(profile: str, rate_hz: float = 10.0, law: str = "gauss") -> MonteCarlo:
    nees, errors, bounds, low, nis = [], [], [], [], []
    for seed in range(RUNS):
        run = run_of(profile, seed, rate_hz=rate_hz, law=law)
        prior = prior_drawn_around(run.parameters, seed)
        found = filter_log(run.course, constants_for(law=law), prior.mean, prior.covariance, keep_states=True)
        error = found.mean[1:] - np.array(run.parameters)
        nees.append(float(error @ np.linalg.solve(found.covariance[1:, 1:], error)))
        errors.append(error)
        bounds.append(cramer_rao_std(run, 1.0, law))
        slow = np.abs(run.speed_rad_s) < 100.0 * RAD_S_PER_RPM
        low.append(float(np.mean((found.states[slow, 0] - run.speed_rad_s[slow]) ** 2)))
        nis.append(float(np.nanmean(found.nis)))
    return MonteCarlo(np.array(nees), np.array(errors), np.array(bounds), np.array(low), np.array(nis))


@pytest.mark.slow
@pytest.mark.parametrize("profile", PUBLISHED)
def test_the_error_bars_of_the_parameters_can_be_believed(profile: str) -> None:
    """Mean NEES over 24 runs is at most 6 on every published profile, and no run is lost (45: p below 1e-8)."""
    found = monte_carlo(profile)
    assert found.nees.mean() <= 6.0
    assert found.nees.max() < 45.0
    assert found.nis.mean() == pytest.approx(1.0, abs=0.08)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["tustin", "lorentz"])
def test_the_error_bars_can_be_believed_under_every_stribeck_law(law: str) -> None:
    """Where truth and filter share another law, mean NEES stays at most 6 on P1."""
    assert monte_carlo("P1", law=law).nees.mean() <= 6.0


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [1.0, 2.0, 100.0])
def test_the_error_bars_can_be_believed_at_other_rates(rate_hz: float) -> None:
    """From 1 Hz, where an interval hides a whole reversal, to 100 Hz the mean NEES stays at most 6 on P1."""
    assert monte_carlo("P1", rate_hz=rate_hz).nees.mean() <= 6.0


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["P1", "P2"])
def test_break_away_friction_is_found_nearly_as_well_as_can_be(profile: str) -> None:
    """The RMS error of T_s/J on P1 and P2 is at most 2.5 Cramer-Rao bounds."""
    found = monte_carlo(profile)
    assert float(np.sqrt(np.mean((found.errors[:, 3] / found.bounds[:, 3]) ** 2))) <= 2.5


@pytest.mark.slow
def test_the_speed_is_known_well_near_zero() -> None:
    """On P1 the RMS error of the true speed below 100 rpm is at most 0.13 rpm from readings of 1 rpm."""
    assert float(np.sqrt(monte_carlo("P1").low_speed_mse.mean())) / RAD_S_PER_RPM <= 0.13


@pytest.mark.parametrize("profile", ["P2", "S3"])
def test_the_bound_from_the_models_jacobian_is_that_of_the_fine_step_truth(profile: str) -> None:
    """The Cramer-Rao bound does not depend on whose sensitivities are used: flow map or differences of the truth."""
    run = run_of(profile, 1)
    np.testing.assert_allclose(cramer_rao_std(run, 1.0), cramer_rao_std_fine(run, 1.0), rtol=0.03)


@pytest.mark.parametrize("profile", ["P1", "S2"])
def test_two_independent_plants_agree(profile: str) -> None:
    """The simulated wheel of the drivers and the tests' fine-step truth give the same speed to 0.001 rpm."""
    run = run_of(profile, 1)
    parameters = PlantParameters(**run.parameters._asdict())
    plant = simulate_run(parameters, run.current_A, run.time_s, PlantNoise(speed_rad_s=0.0))
    assert np.max(np.abs(plant.speed_rad_s - run.speed_rad_s)) < 1e-3 * RAD_S_PER_RPM


def _poor_prior(static: float) -> Belief:
    """The default prior with an independent, poor guess of T_s/J."""
    mean, covariance = DEFAULT_PRIOR.mean.copy(), DEFAULT_PRIOR.covariance.copy()
    mean[4] = static
    covariance[4, :] = covariance[:, 4] = 0.0
    covariance[4, 4] = 0.7**2
    return Belief(mean, covariance)


@pytest.mark.slow
@pytest.mark.parametrize("static", [0.0, CK13_STATISTICAL.coulomb, 1.2])
def test_a_poor_prior_on_break_away_friction_never_loses_the_filter(static: float) -> None:
    """From T_s/J = 0, c and 1.2 (sigma 0.7), 40 runs each over P1, P2 and S2 to S4: not one diverges.

    Diverged is a T_s further than 0.5 or 6 sigma from the truth at the end, or a speed lost by more than 1 rpm RMS.
    """
    prior = _poor_prior(static)
    for profile, runs in (("P1", 20), ("P2", 14), ("S2", 2), ("S3", 2), ("S4", 2)):
        for seed in range(runs):
            run = run_of(profile, seed)
            found = filter_log(run.course, constants_for(), prior.mean, prior.covariance, keep_states=True)
            error = abs(float(found.mean[4]) - run.parameters.static)
            speed_error = (found.states[50:, 0] - run.speed_rad_s[50:]) / RAD_S_PER_RPM
            assert error < 0.5, (profile, seed)
            assert error < 6.0 * np.sqrt(found.covariance[4, 4]), (profile, seed)
            assert np.sqrt(np.mean(speed_error**2)) < 1.0, (profile, seed)


def test_a_wheel_believed_stuck_is_known_to_be_perhaps_not() -> None:
    """Break-away within sqrt(3) sigma counts, even where no single parameter alone could bring it about.

    Here s - k I = 0.67 with sigma 0.44, shared between k, c and the excess of s: sigma points along Cholesky's columns
    all stay stuck, the derivative is zero, and the first readings of a wheel that moves would be thrown out as spikes.
    """
    mean, covariance = DEFAULT_PRIOR.mean.copy(), DEFAULT_PRIOR.covariance.copy()
    mean[4] = 1.13
    covariance[0, 0] = 1e-4
    row = np.zeros(5)
    pieces = Pieces([0.0], [0.1], [0.03])
    speed, extra = transition(mean, covariance, Stribeck(OMEGA_S, 0), pieces, 0, 1, row, np.zeros((7, 5)))
    assert speed == 0.0
    assert row[1] > 0.0
    assert row[4] < 0.0
    assert row @ covariance @ row + extra > (0.03 * RAD_S_PER_RPM) ** 2


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["S2", "S3", "S5"])
def test_no_run_in_a_hundred_is_lost(profile: str) -> None:
    """From vague priors, over 100 runs of the profiles that begin at rest, not one ends with a NEES above 45."""
    for seed in range(100, 200):
        run = run_of(profile, seed)
        prior = prior_drawn_around(run.parameters, seed)
        found = filter_log(run.course, constants_for(), prior.mean, prior.covariance)
        error = found.mean[1:] - np.array(run.parameters)
        assert error @ np.linalg.solve(found.covariance[1:, 1:], error) < 45.0, seed


def test_a_wheel_that_stood_for_an_hour_is_identified_when_it_moves() -> None:
    """An hour at rest teaches that s > k I and nothing else; afterwards the parameters come out within 4 sigma."""
    time_s = np.arange(0.0, 3900.0, 0.1)
    current = np.where(time_s < 3600.0, 0.03, 0.1 * np.sin(2.0 * np.pi * (time_s - 3600.0) / 30.0))
    speed = fine_trajectory(CK13_STATISTICAL, time_s, current)
    reading = speed + RAD_S_PER_RPM * np.random.default_rng(1).standard_normal(time_s.size)
    course = Course.of(time_s, reading, current)
    run = filter_log(course, constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance, keep_states=True)
    rested = 35_990
    assert np.all(run.stds[rested, 1:4] > 0.8 * DEFAULT_PRIOR.std[1:4])
    # All that standing tells is s > k I: the prior cut off there has these moments.
    k, _, _, s = DEFAULT_PRIOR.mean[1:]
    spread = np.sqrt(DEFAULT_PRIOR.covariance[4, 4] + 0.03**2 * DEFAULT_PRIOR.covariance[1, 1])
    cut = truncnorm((0.03 * k - s) / spread, np.inf)
    share = DEFAULT_PRIOR.covariance[4, 4] / spread
    assert run.states[rested, 4] == pytest.approx(s + share * cut.mean(), abs=0.05)
    assert run.stds[rested, 4] == pytest.approx(
        np.sqrt(DEFAULT_PRIOR.covariance[4, 4] - share**2 * (1.0 - cut.var())), rel=0.15
    )
    sigmas = (run.mean[1:] - np.array(CK13_STATISTICAL)) / np.sqrt(np.diag(run.covariance))[1:]
    assert np.max(np.abs(sigmas)) < 4.0


@pytest.mark.parametrize(("grid_rpm", "sigma_rpm"), [(0.5, 0.15), (0.5, 1.0), (5.0, 1.5)])
def test_readings_on_a_grid_do_no_harm(grid_rpm: float, sigma_rpm: float) -> None:
    """Readings rounded to 0.5 or 5 rpm, noise taken as the grid's or more, leave the parameters within 4 sigma."""
    for profile in ("P1", "P2"):
        run = run_of(profile, 1)
        grid = grid_rpm * RAD_S_PER_RPM
        course = Course.of(run.time_s, np.round(run.speed_rad_s / grid) * grid, run.current_A)
        found = filter_log(course, constants_for(sigma_rpm), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
        sigmas = (found.mean[1:] - np.array(run.parameters)) / np.sqrt(np.diag(found.covariance))[1:]
        assert np.max(np.abs(sigmas)) < 4.0


def test_one_wild_reading_in_three_does_no_harm() -> None:
    """With 30 % of the readings off by 200 rpm the gate and the re-seeding keep the parameters within 4 sigma."""
    run = run_of("P1", 2)
    rng = np.random.default_rng(3)
    reading = run.reading_rad_s.copy()
    wild = rng.random(reading.size) < 0.3
    reading[wild] += 200.0 * RAD_S_PER_RPM * rng.standard_normal(int(wild.sum()))
    found = filter_log(
        Course.of(run.time_s, reading, run.current_A),
        constants_for(),
        DEFAULT_PRIOR.mean,
        DEFAULT_PRIOR.covariance,
    )
    sigmas = (found.mean[1:] - np.array(run.parameters)) / np.sqrt(np.diag(found.covariance))[1:]
    assert np.max(np.abs(sigmas)) < 4.0


def test_strong_current_pulses_are_followed() -> None:
    """Pulses of 3 to 5 A for one period, far beyond the rest of the profile, leave the parameters within 4 sigma."""
    run = run_of("P1", 2)
    current = run.current_A.copy()
    current[[500, 900, 1500]] = 3.0, -4.0, 5.0
    speed = fine_trajectory(run.parameters, run.time_s, current)
    reading = speed + (run.reading_rad_s - run.speed_rad_s)
    found = filter_log(
        Course.of(run.time_s, reading, current), constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance
    )
    sigmas = (found.mean[1:] - np.array(run.parameters)) / np.sqrt(np.diag(found.covariance))[1:]
    assert np.max(np.abs(sigmas)) < 4.0


@pytest.mark.parametrize(
    "parameters",
    [
        FrictionParameters(15.2, 0.003, 0.6, 0.4),  # s < c: friction that grows with speed
        FrictionParameters(15.2, 0.003, 0.6, 0.9),  # a strong Stribeck peak
        FrictionParameters(10.6, 0.0064, 0.3, 0.32),  # the edge of the default prior
        FrictionParameters(19.8, 0.0005, 0.88, 0.9),
    ],
)
def test_other_wheels_are_identified_from_the_default_prior(parameters: FrictionParameters) -> None:
    """A wheel anywhere in the default prior, s < c included, comes out within 4 sigma on P2, its speed to 0.3 rpm."""
    run = run_of("P2", 1, parameters=parameters)
    found = filter_log(run.course, constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance, keep_states=True)
    sigmas = (found.mean[1:] - np.array(parameters)) / np.sqrt(np.diag(found.covariance))[1:]
    assert np.max(np.abs(sigmas)) < 4.0
    speed_error = (found.states[200:, 0] - run.speed_rad_s[200:]) / RAD_S_PER_RPM
    assert np.sqrt(np.mean(speed_error**2)) < 0.3


@pytest.mark.slow
@pytest.mark.parametrize("quiet", [False, True])
def test_the_covariance_survives_a_million_samples(quiet: bool) -> None:
    """After 28 hours at 10 Hz the covariance is symmetric with positive eigenvalues, even with no process noise asked.

    Under a constant current only a combination of k, c and s is seen, which is the worst case for rounding.
    """
    n, started = 1_000_000, 300
    time_s, current = np.linspace(0.0, 0.1 * (n - 1), n), np.full(n, 0.05)
    k, b, c, _ = CK13_STATISTICAL
    speed = np.empty(n)
    speed[:started] = fine_trajectory(CK13_STATISTICAL, time_s[:started], current[:started])
    last = (k * 0.05 - c) / b  # from here on the closed form
    speed[started:] = last + (speed[started - 1] - last) * np.exp(-b * (time_s[started:] - time_s[started - 1]))
    reading = speed + RAD_S_PER_RPM * np.random.default_rng(4).standard_normal(n)
    constants = constants_for(acceleration_rpm=0.0 if quiet else None)
    if quiet:
        constants = constants._replace(motor_gain_drift=0.0, viscous_drift=0.0, coulomb_drift=0.0, static_drift=0.0)
    course = Course.of(time_s, reading, current)
    run = filter_log(course, constants, DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance, keep_states=True)
    assert np.isfinite(run.stds).all()
    assert (run.covariance == run.covariance.T).all()
    scale = np.sqrt(np.diag(run.covariance))
    assert np.linalg.eigvalsh(run.covariance / np.outer(scale, scale))[0] > -1e-12


def test_the_factor_multiplies_back_to_the_covariance() -> None:
    """L L' = P for random covariances, and a direction without variance has a zero column and row."""
    rng = np.random.default_rng(5)
    for frozen in (None, 2, 0):
        root = rng.standard_normal((5, 5)) * np.array([1e-2, 3.0, 1e-3, 0.1, 0.1])[:, None]
        P = root @ root.T
        if frozen is not None:
            P[frozen], P[:, frozen] = 0.0, 0.0
        L = np.zeros((5, 5))
        factor_covariance(P, L)
        scale = np.sqrt(np.where(np.diag(P) > 0.0, np.diag(P), 1.0))
        np.testing.assert_allclose(L @ L.T / np.outer(scale, scale), P / np.outer(scale, scale), atol=1e-12)
