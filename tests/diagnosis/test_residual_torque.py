"""The residual torque that figures and pictures show, before and after an effect with a memory."""

from __future__ import annotations

import numpy as np

from rw_ekf.diagnosis.judge.heldout import performance
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.model.effect import Term
from tests.diagnosis.simulated import log_of, simulated


def test_a_bristle_in_the_model_leaves_no_more_torque_than_there_was_without_it() -> None:
    """Of a wheel on a bristle the residual torque is no larger with the bristle than without; at rest there is none."""
    run = simulated(["presliding_hysteresis:deflection_rad=0.03,damping=0.3"], seed=21, samples=3000)
    prepared = prepare(source_of([log_of(run)]), None, None, "blocks")
    bristle = Term.of(CATALOGUE["presliding_hysteresis"], (0.3, 0.0, 0.0), 0.03)
    fit = prepared.base.refitted(prepared.base.model.with_terms(bristle))
    before, after = performance(prepared, prepared.base), performance(prepared, fit)
    assert after.figures["torque_rms_mNm"] < 1.02 * before.figures["torque_rms_mNm"]
    seen = [np.isfinite(found.trace.residual_acceleration_rad_s2) for found in (before, after)]
    assert (seen[0] == seen[1]).all()  # compared over the same samples
    moving = np.abs(run.speed_rad_s) > 1.0
    assert seen[1][moving].mean() > 0.99
    assert not seen[1][~moving].all()
