"""A friction with a memory is found where readings are too noisy for smoothing to show when the wheel breaks away."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.effects.friction_lag import FrictionLag
from rw_ekf.likelihood.free_path import free_trajectory
from rw_ekf.model.effect import Candidate, Term
from rw_ekf.units import RAD_S_PER_RPM
from tests.diagnosis.simulated import log_of, simulated

LAG_S = 0.25


@pytest.mark.parametrize("start_s", [0.06, 0.6])
def test_a_lag_of_friction_is_fitted_at_5_rpm_from_either_side(start_s: float) -> None:
    """The likelihood gains, and the lag comes out within four of its sigmas, wherever the fit begins."""
    run = simulated([f"friction_lag:time_constant_s={LAG_S}"], seed=23, noise_rpm=5.0)
    base = prepare(source_of([log_of(run)]), None, None, "blocks").base
    fit = base.refitted(base.model.with_terms(Term.at(FrictionLag, Candidate(start_s))))
    (found,) = fit.terms_of("friction_lag")
    assert 2.0 * (fit.likelihood.value - base.likelihood.value) > 25.0
    assert abs(found.term.values[0] - LAG_S) < 4.0 * np.sqrt(found.covariance[0, 0])


def test_a_free_run_is_nearer_to_the_speed_than_its_readings() -> None:
    """Of the model that was fitted, from the first reading on; its spread is that of a speed that is known."""
    run = simulated([], seed=29, noise_rpm=5.0)
    base = prepare(source_of([log_of(run)]), None, None, "blocks").base
    path = free_trajectory(base.linearised.record, base.model, base.trajectory, base.noise)
    assert np.std(path.speed - run.speed_rad_s) < 0.5 * RAD_S_PER_RPM
    assert np.all(np.isnan(path.memory))
    assert np.all(path.spread < 0.2 * RAD_S_PER_RPM)
