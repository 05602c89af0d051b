"""Noises of a record by restricted likelihood, the ratio integrated out, where the truth's are known."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from rw_ekf.course.course import Course
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.likelihood.log_fit import fit_log
from rw_ekf.likelihood.noise_posterior import NoisePosterior
from rw_ekf.units import RAD_S_PER_RPM
from tests.truth import fine_trajectory, run_of
from tools.measure.runs import constants_for

pytestmark = pytest.mark.xdist_group("noises")  # fits are made once

SEEDS = range(8)


@lru_cache
def fits(noise_rpm: float, process_rpm: float) -> list[NoisePosterior]:
    """Fits to runs of P1 whose speed also walks at random by process_rpm per sqrt(s); the first guess is wrong."""
    found = []
    for seed in SEEDS:
        run = run_of("P1", seed, noise_rpm=noise_rpm)
        kicks = np.random.default_rng(500 + seed).standard_normal(run.time_s.size)
        speed = fine_trajectory(
            run.parameters,
            run.time_s,
            run.current_A,
            kicks_rad_s=process_rpm * RAD_S_PER_RPM * np.sqrt(0.1) * kicks,
        )
        reading = speed + (run.reading_rad_s - run.speed_rad_s)
        course = Course.of(run.time_s, reading, run.current_A)
        found.append(fit_log(course, constants_for(1.7 * noise_rpm), DEFAULT_PRIOR, run.parameters).noises)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("noise_rpm", [1.0, 5.0])
def test_the_speed_noise_is_found(noise_rpm: float) -> None:
    """From a first guess 70 % off, R comes out within 3 % in every run (one sigma is 1.3 %), whatever the guess."""
    for fit in fits(noise_rpm, 0.0):
        assert fit.speed_noise_rad_s / RAD_S_PER_RPM == pytest.approx(noise_rpm, rel=0.03)
        assert fit.speed_noise_std == pytest.approx(0.013 * fit.speed_noise_rad_s, rel=0.3)


@pytest.mark.slow
def test_no_process_noise_is_a_small_number_and_never_zero() -> None:
    """Where the truth has none, at most one fit in eight asks for some; all allow for a little, below 0.05 rpm."""
    found = fits(1.0, 0.0)
    assert sum(fit.acceleration_noise_seen for fit in found) <= 1
    assert all(0.0 < fit.acceleration_noise <= fit.acceleration_noise_limit for fit in found)
    assert all(fit.acceleration_noise_limit < 0.05 * RAD_S_PER_RPM for fit in found)


@pytest.mark.slow
@pytest.mark.parametrize("process_rpm", [0.1, 0.3])
def test_process_noise_is_found_within_its_own_error_bar(process_rpm: float) -> None:
    """Eight estimates scatter about the truth as their sigmas say, on the logarithm: a sigma grows with its value."""
    found = fits(1.0, process_rpm)
    assert all(fit.acceleration_noise_seen for fit in found)
    errors = np.array([np.log(fit.acceleration_noise / (process_rpm * RAD_S_PER_RPM)) for fit in found])
    spread = np.array([fit.acceleration_noise_std / fit.acceleration_noise for fit in found])
    assert np.max(np.abs(errors / spread)) < 3.5
    assert 0.4 < float(np.sqrt(np.mean((errors / spread) ** 2))) < 1.7
    assert np.all(np.abs(errors) < 0.7)


def test_spikes_do_not_pass_for_noise() -> None:
    """Ten wild readings are left out beforehand: R stays within 4 %."""
    run = run_of("P1", 3)
    reading = run.reading_rad_s.copy()
    reading[50::300] += 60.0
    fit = fit_log(Course.of(run.time_s, reading, run.current_A), constants_for(), DEFAULT_PRIOR, run.parameters)
    assert fit.noises.speed_noise_rad_s == pytest.approx(RAD_S_PER_RPM, rel=0.04)
    assert fit.left_out == 10
