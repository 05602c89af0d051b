"""`Fit.summary()`: each figure against an independent computation."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from scipy.stats import chi2

import rw_ekf

RPM = math.pi / 30.0


@pytest.fixture(scope="module")
def fit() -> rw_ekf.Fit:
    """Of a wheel that has nothing beside its four parameters, read with 1 rpm."""
    return rw_ekf.fit(rw_ekf.simulate("identification", seed=3, duration_s=300.0), noise=True)


def test_the_residual_of_a_right_model_has_the_figures_of_noise(fit: rw_ekf.Fit) -> None:
    """Share explained: all but the readings' noise; likelihood: a Gaussian's of the innovations' own spread; white."""
    found = fit.summary()
    moved = float(np.nanstd(found.residual.measured_rad_s))
    assert found.free_run_percent == pytest.approx(100.0 * (1.0 - RPM / moved), abs=10.0 * RPM / moved)
    assert found.free_run_percent < found.one_step_percent + 0.05
    spread = float(np.nanstd(found.residual.one_step_rad_s))
    gaussian = -0.5 * found.readings * (math.log(2.0 * math.pi * spread**2) + 1.0)
    assert found.residual.log_likelihood == pytest.approx(gaussian, abs=0.01 * found.readings)
    assert np.sum(np.abs(found.autocorrelation) > found.white_band) <= 4
    assert found.document()["ljung_box_p"] > 0.01


def test_criteria_and_correlations_follow_their_formulas(fit: rw_ekf.Fit) -> None:
    """AIC, BIC, autocorrelation and Ljung-Box by numpy and scipy; the JSON is the document."""
    found = fit.summary()
    document = json.loads(found.to_json())
    assert document["aic"] == pytest.approx(2.0 * 6 - 2.0 * document["log_likelihood"])
    assert document["bic"] == pytest.approx(6 * math.log(document["readings"]) - 2.0 * document["log_likelihood"])
    z = found.residual.standardised - found.residual.standardised.mean()
    whole = np.correlate(z, z, "full")[z.size - 1 :]
    np.testing.assert_allclose(found.autocorrelation, whole[1:21] / whole[0], rtol=1e-9)
    lags = np.arange(1, 21)
    q = z.size * (z.size + 2.0) * np.sum((whole[1:21] / whole[0]) ** 2 / (z.size - lags))
    assert document["ljung_box_p"] == pytest.approx(chi2.sf(q, 20), rel=1e-9)
    assert "AIC" in str(found)
    assert fit.table.column("name").to_pylist() == ["motor_gain", "viscous", "coulomb", "static"]


def test_the_correlation_is_that_of_many_fits() -> None:
    """Viscous and Coulomb friction of thirty logs of one wheel are correlated as each fit says."""
    fits = [rw_ekf.fit(rw_ekf.simulate("P1", seed=seed, duration_s=120.0)) for seed in range(30)]
    summaries = [fit.summary() for fit in fits]
    names = list(summaries[0].numbers)
    i, j = names.index("viscous"), names.index("coulomb")
    values = np.array([[summary.numbers[name][0] for name in names] for summary in summaries])
    seen = float(np.corrcoef(values[:, i], values[:, j])[0, 1])
    reported = float(np.mean([summary.correlation[i, j] for summary in summaries]))
    # Fisher: the inverse hyperbolic tangent of a correlation of thirty has a spread of 1 / sqrt(27).
    assert math.atanh(seen) == pytest.approx(math.atanh(reported), abs=3.0 / math.sqrt(27.0))


def test_what_a_motion_does_not_tell_is_named_with_the_motion_that_would() -> None:
    """A wheel that never starts from rest does not tell its break-away friction; an effect is a number like others."""
    log = rw_ekf.simulate("sine", seed=4, duration_s=120.0, amplitude_A=0.05, bias_A=0.3)
    late = log.time_s > 20.0
    moving = rw_ekf.Log.from_arrays(
        log.time_s[late], speed_rad_s=log.speed_rad_s[late], current_A=log.current_A[late], name="moving"
    )
    assert any(
        text.startswith("static is not told") and "rest" in text for text in rw_ekf.fit(moving).summary().unknown
    )
    wheel = rw_ekf.simulate("identification", effects=["quadratic_drag"], seed=5)
    model = rw_ekf.diagnose(wheel).model
    again = rw_ekf.fit(wheel, model).summary()
    assert "quadratic_drag.coefficient_1_rad" in again.numbers
    assert again.correlation.shape == (5, 5)
    assert again.fitted == 7


def test_a_reading_that_is_refused_costs_as_much_as_one_at_the_gate() -> None:
    """Left out, a model that refuses more readings would be the likelier one."""
    log = rw_ekf.simulate("identification", seed=3, duration_s=300.0)
    columns = {"time_s": log.time_s, "current_command_A": log.table["current_command_A"].to_numpy()}
    wild = log.speed_rad_s.copy()
    wild[[800, 1500, 2200]] += 40.0
    clean, off = (
        rw_ekf.fit(rw_ekf.read({**columns, "speed_rad_s": speed}), noise=True).summary()
        for speed in (log.speed_rad_s, wild)
    )
    lost = clean.residual.log_likelihood - off.residual.log_likelihood
    at_the_gate = 0.5 * (chi2.isf(1e-4, 1) - 1.0)
    assert lost == pytest.approx(3.0 * at_the_gate, rel=0.3)
