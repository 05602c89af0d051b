"""The smoother: against the textbook recursion, and for what it is worth."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.gating import UPDATED
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.filter.smoother import smooth_log
from rw_ekf.units import RAD_S_PER_RPM
from tests.filter.replay import compiled
from tests.filter.test_golden import rough_log
from tests.truth import run_of
from tools.measure.runs import constants_for, prior_drawn_around


def rauch_tung_striebel(run: FilterRun, speed_variance: float) -> tuple[Float64Array, Float64Array]:
    """Rauch, Tung and Striebel 1965, scaled: x_s = x_f + C (x_s+ - x_p+), C = P_f F' P_p+^-1."""
    history = run.history
    scale = np.sqrt(np.max(np.diagonal(history.covariance, axis1=1, axis2=2), axis=0))
    n = history.predicted.shape[0]
    filtered, covariance = [], []
    for i in range(n):
        x, P = history.predicted[i] / scale, history.covariance[i] / np.outer(scale, scale)
        if run.outcome[i] == UPDATED:
            gain = P[:, 0] / (P[0, 0] + speed_variance / scale[0] ** 2)
            x = x + gain * run.innovation_rad_s[i] / scale[0]
            P = P - np.outer(gain, P[0])
        filtered.append(x)
        covariance.append(P)
    means, covariances = [filtered[-1]], [covariance[-1]]
    for i in range(n - 2, -1, -1):
        F = np.eye(5)
        F[0] = history.row[i + 1] * scale / scale[0]
        predicted = history.covariance[i + 1] / np.outer(scale, scale)
        gain = np.linalg.lstsq(predicted, F @ covariance[i], rcond=1e-15)[0].T
        means.append(filtered[i] + gain @ (means[-1] - history.predicted[i + 1] / scale))
        covariances.append(covariance[i] + gain @ (covariances[-1] - predicted) @ gain.T)
    spread = np.sqrt(np.maximum(np.diagonal(np.array(covariances), axis1=1, axis2=2), 0.0))
    return np.array(means)[::-1] * scale, spread[::-1] * scale


@pytest.mark.parametrize("profile", ["P1", "P2"])
def test_the_smoother_is_the_textbook_recursion(profile: str) -> None:
    """Bryson and Frazier's form gives what Rauch, Tung and Striebel's gives from the same F, Q and P."""
    sample = run_of(profile, 1)
    constants = constants_for()
    run = filter_log(sample.course, constants, DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance, keep_history=True)
    means, stds = smooth_log(run)
    wanted_means, wanted_stds = rauch_tung_striebel(run, constants.speed_variance)
    assert np.max(np.abs(means - wanted_means) / wanted_stds) < 1e-3
    np.testing.assert_allclose(stds, wanted_stds, rtol=1e-3)


def test_the_smoother_is_the_textbook_recursion_on_a_rough_log() -> None:
    """Gaps, segments, skipped rows, spikes and re-seeding change nothing of that."""
    constants = constants_for()
    run = compiled(rough_log("P2", 4, "gauss"), constants, DEFAULT_PRIOR, keep_history=True)
    means, stds = smooth_log(run)
    wanted_means, wanted_stds = rauch_tung_striebel(run, constants.speed_variance)
    assert np.max(np.abs(means - wanted_means) / wanted_stds) < 1e-3
    np.testing.assert_allclose(stds, wanted_stds, rtol=1e-3)


def test_smoothing_ends_where_filtering_ends() -> None:
    """The last smoothed state is the last filtered one: there is no future left to learn from."""
    sample = run_of("P1", 2)
    constants = constants_for()
    run = filter_log(sample.course, constants, DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance, keep_history=True)
    means, stds = smooth_log(run)
    np.testing.assert_allclose(means[-1], run.mean, rtol=1e-10)
    np.testing.assert_allclose(stds[-1], np.sqrt(np.diag(run.covariance)), rtol=1e-8)


def test_smoothing_takes_two_fifths_off_the_speed_error_of_profile_1() -> None:
    """RMS error of the true speed on P1, 1 rpm readings: below 0.15 rpm filtered, below 0.095 rpm smoothed."""
    before, after = [], []
    constants = constants_for()
    for seed in range(8):
        sample = run_of("P1", seed)
        prior = prior_drawn_around(sample.parameters, seed)
        run = filter_log(sample.course, constants, prior.mean, prior.covariance, keep_states=True, keep_history=True)
        means, _ = smooth_log(run)
        before.append(np.mean((run.states[:, 0] - sample.speed_rad_s) ** 2))
        after.append(np.mean((means[:, 0] - sample.speed_rad_s) ** 2))
    filtered, smoothed = (float(np.sqrt(np.mean(v))) / RAD_S_PER_RPM for v in (before, after))
    assert filtered < 0.15
    assert smoothed < 0.095
    assert smoothed < 0.7 * filtered


def test_smoothing_without_a_history_says_what_is_missing() -> None:
    """A run made without its history cannot be smoothed: ValueError names the option."""
    sample = run_of("P1", 2)
    run = filter_log(sample.course, constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
    with pytest.raises(ValueError, match="keep_history"):
        smooth_log(run)
