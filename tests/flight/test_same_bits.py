"""The four-parameter filter in C: the bits of the estimator and of the compiled pass; single precision in a bound."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.course.course import Course
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.filter.constants import filter_constants
from rw_ekf.filter.estimator import Estimator
from rw_ekf.filter.health_monitor import TROUBLES
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.flight.self_test import SIGMAS
from rw_ekf.log_simulation import simulate
from rw_ekf.records import IssuedCommand, WheelSample
from tests.filter.replay import OUTCOMES, Columns
from tests.flight.c_library import compiled, in_c, needs_gcc, same_bits, setup_for
from tools.measure.runs import OMEGA_S

_CODES = {trouble: code for code, trouble in TROUBLES.items()}
_CONSTANTS = filter_constants(OMEGA_S)
_PROFILES = ("identification", "P1", "P2", "steps", "sine", "random-sines")
_BLOCK_S = 2000.0


def long_log(n: int, seed: int = 4) -> Columns:
    """Reversals, rests, creep; gaps, repeated and backward times, outliers, bursts, losses, segments, late commands.

    For a third of the time the readings are of another wheel, whose speeds are 1.7 times as large, so that the filter
    has to be mended.
    """
    rng = np.random.default_rng(seed)
    parts = [simulate(profile, seed=seed, duration_s=_BLOCK_S) for profile in _PROFILES]
    speed = np.resize(np.concatenate([np.asarray(part.speed_rad_s) for part in parts]), n)
    current = np.resize(np.concatenate([np.asarray(part.current_A) for part in parts]), n)
    speed += rng.normal(0.0, 0.02, n)
    for at in range(0, n, 90_000):
        speed[at + 40_000 : at + 60_000] *= 1.7
        speed[at + 60_000 : at + 61_000] = 0.0
    time_s = np.cumsum(np.where(rng.random(n) < 0.001, rng.uniform(0.0, 4.0, n), 0.1))
    time_s[rng.random(n) < 0.0005] -= 0.15
    again = np.flatnonzero(rng.random(n) < 0.0005)
    again = again[again > 0]
    time_s[again] = time_s[again - 1]
    wild = rng.random(n) < 0.003
    speed[wild] += rng.normal(0.0, 50.0, int(wild.sum()))
    for at in np.flatnonzero(rng.random(n) < 0.0002).tolist():
        speed[at : at + 30] += 20.0
    speed[rng.random(n) < 0.01] = math.nan
    segment = np.cumsum(rng.random(n) < 0.0001)
    delay = np.where(rng.random(n) < 0.5, 0.0, rng.uniform(0.0, 0.08, n))
    delay[rng.random(n) < 0.01] = 0.35
    return Columns(time_s, speed, current, delay, segment - segment[0])


@needs_gcc
@pytest.mark.parametrize(
    "samples",
    [pytest.param(10_000, id="short"), pytest.param(70_000, id="long", marks=pytest.mark.slow)],
)
def test_every_sample_has_the_bits_of_the_estimator(samples: int, tmp_path: Path) -> None:
    """Outcome, trouble, all means and all covariances of every sample: not one bit differs.

    Every outcome is there, the rarest 35 times; a million samples are compared with the compiled pass below.
    """
    log = long_log(samples)
    found = in_c(compiled(tmp_path, setup_for(_CONSTANTS, DEFAULT_PRIOR)), log)
    estimator = Estimator(_CONSTANTS, DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
    mean, covariance = np.empty_like(found.mean), np.empty_like(found.covariance)
    same = 0
    for i in range(samples):
        reading = None if math.isnan(log.speed_rad_s[i]) else float(log.speed_rad_s[i])
        estimate = estimator.step(WheelSample(float(log.time_s[i]), reading, segment=int(log.segment[i])))
        trouble = 0 if estimate.health is None else _CODES[estimate.health.trouble]
        same += estimate.outcome == OUTCOMES[found.outcome[i]] and trouble == found.trouble[i]
        mean[i], covariance[i] = estimator.ekf.x, estimator.ekf.P
        estimator.command_issued(IssuedCommand(float(log.current_A[i]), float(log.delay_s[i])))
    assert same == samples
    assert same_bits(mean, found.mean)
    assert same_bits(covariance, found.covariance)
    assert set(range(7)) <= set(found.outcome.tolist())
    if samples > 60_000:  # it has a stretch of readings of another wheel
        assert set(found.trouble.tolist()) > {0}


@needs_gcc
def test_the_compiled_pass_has_them_too(tmp_path: Path) -> None:
    """What flies and the compiled pass are one filter to the last bit: a million samples with mended divergences."""
    log = long_log(1_000_000)
    found = in_c(compiled(tmp_path, setup_for(_CONSTANTS, DEFAULT_PRIOR)), log)
    course = Course.of(log.time_s, log.speed_rad_s, log.current_A, log.delay_s, log.segment)
    belief = DEFAULT_PRIOR
    run = filter_log(course, _CONSTANTS, belief.mean, belief.covariance, keep_states=True, mends=True)
    assert run.mended.any()
    assert np.array_equal(run.outcome, found.outcome)
    assert same_bits(run.states, found.mean)
    assert same_bits(run.stds, np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2)))


@needs_gcc
@pytest.mark.slow
@pytest.mark.parametrize("profile", _PROFILES)
def test_single_precision_stays_within_its_bound(profile: str, tmp_path: Path) -> None:
    """100,000 readings of a wheel: never further than the stated share of a sigma, and no decision differs."""
    run = simulate(profile, seed=3, duration_s=10_000.0)
    log = Columns(np.asarray(run.time_s) + 1.0e7, np.asarray(run.speed_rad_s), np.asarray(run.current_A))
    (tmp_path / "double").mkdir()
    double = in_c(compiled(tmp_path / "double", setup_for(_CONSTANTS, DEFAULT_PRIOR)), log)
    (tmp_path / "single").mkdir()
    single = in_c(compiled(tmp_path / "single", setup_for(_CONSTANTS, DEFAULT_PRIOR), single=True), log)
    assert np.array_equal(double.outcome, single.outcome)
    assert np.array_equal(double.trouble, single.trouble)
    sigma = np.sqrt(np.diagonal(double.covariance, axis1=1, axis2=2))
    assert np.max(np.abs(single.mean - double.mean) / sigma) < SIGMAS
    assert np.max(np.abs(np.sqrt(np.diagonal(single.covariance, axis1=1, axis2=2)) / sigma - 1.0)) < SIGMAS
