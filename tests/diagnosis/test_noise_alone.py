"""What noise alone makes of the residual's map: drawn from the fit, and no more accused than drawn."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.diagnosis.checks.noise_alone import noise_draws, p_values_by_draws
from rw_ekf.diagnosis.checks.residual_map import covers_of
from rw_ekf.diagnosis.hypotheses.joint_regressors import fit_group, statistics_alone
from rw_ekf.diagnosis.hypotheses.noise_ratios import Profiled
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.preparation import Prepared, prepare
from rw_ekf.diagnosis.prepare.source import source_of
from tests.diagnosis.simulated import log_of, simulated

MOVED_RPM = 0.1  # by torque noise, in a second: barely seen beside readings of 1 rpm


@pytest.fixture(scope="module")
def restless() -> Prepared:
    """A healthy wheel with torque noise, of which chi-square said that it goes with time at 4e-7."""
    run = simulated([], seed=5027, profile="P2", process_rpm=MOVED_RPM)
    return prepare(source_of([log_of(run)]), None, None, "blocks")


def test_draws_are_white_where_the_fit_whitens(restless: Prepared) -> None:
    """Unit variance and no correlation from reading to reading, at the fit's own noises."""
    fit = restless.base
    white = fit.linearised.whitened(fit.noise.ratio, fit.noise.variance, *noise_draws(fit, 40))[1]
    assert white.var() == pytest.approx(1.0, abs=0.02)
    assert abs(float(np.mean(white[1:] * white[:-1]))) < 0.02


def test_hats_over_time_follow_torque_noise_and_it_is_known_how_far(restless: Prepared) -> None:
    """Noise alone gains more than its degrees of freedom; p-values of its own records are even, those of others not."""
    fit = restless.base
    profiled = Profiled(fit)
    regressors = np.concatenate([c.regressors for c in covers_of(fit, restless.facts)["time"]], axis=1)
    alone = statistics_alone(profiled, [regressors], *noise_draws(fit, 200))[0]
    group = fit_group(profiled, regressors)
    assert np.mean(alone) > 1.5 * group.freedom
    statistics = [*(float(np.quantile(alone, q)) for q in (0.1, 0.5, 0.9)), 400.0]
    *p, least = p_values_by_draws(fit, profiled, [regressors] * len(statistics), statistics)
    np.testing.assert_allclose(p, [0.9, 0.5, 0.1], atol=0.07)
    assert least < 1.0e-12


def test_a_healthy_wheel_with_torque_noise_is_adequate() -> None:
    """What chi-square called structure in time at 4e-7 is noise."""
    document = diagnose_log(log_of(simulated([], seed=5027, profile="P2", process_rpm=MOVED_RPM))).document()
    assert document["verdict"]["kind"] == "adequate", document["verdict"]["statement"]
    time = next(item for item in document["map"] if item["dependence"] == "time")
    assert time["p_value"] > 1.0e-3
