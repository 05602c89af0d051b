"""The residual torque that figures and pictures show, before and after an effect with a memory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rw_ekf.diagnosis.checks.heldout import performance
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.model.effect import Candidate, Term
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


def test_a_ripple_whose_angle_a_gap_lost_leaves_a_residual_torque_that_is_a_number() -> None:
    """A ripple is followed without a logged angle in a record with a gap: its residual torque is known, and smaller."""
    run = simulated(["torque_ripple:order=2,amplitude_rad_s2=0.15"], seed=22, samples=3000)
    log = log_of(run)
    late = 10.0 * (np.arange(3000) >= 1500)
    prepared = prepare(source_of([replace(log, time_s=log.time_s + late)]), None, None, "blocks")
    ripple = replace(Term.at(CATALOGUE["torque_ripple"], Candidate(1.0, (2.0, 0.0, 0.0))), values=(0.1, 0.0))
    fit = prepared.base.refitted(prepared.base.model.with_terms(ripple))
    assert prepared.record.has_gaps
    assert fit.trajectory.angle.size == 3000
    before, after = performance(prepared, prepared.base), performance(prepared, fit)
    assert np.isfinite(after.trace.residual_acceleration_rad_s2).mean() > 0.9
    assert after.figures["torque_rms_mNm"] < before.figures["torque_rms_mNm"]
