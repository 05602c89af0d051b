"""Fits that must not end in the wrong valley: of an effect that is much larger than noise, and of a noisy base."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import fit_model
from rw_ekf.likelihood.model import Model
from rw_ekf.likelihood.one_step import Trajectory
from rw_ekf.model.effect import Term
from rw_ekf.model.state import FrictionParameters
from tests.diagnosis.simulated import fitted, record_of, simulated
from tools.proof.marks import case_called
from tools.proof.plants import log_of, run_of


def test_a_sine_is_followed_from_a_line_beside_its_own() -> None:
    """The model without the torque pays with so much torque noise that every step towards it could pass for a loss."""
    effect = "external_torque:amplitude_rad_s2=0.07,frequency_Hz=0.0377,phase_rad=2.77"
    base = fitted(record_of(simulated([effect], seed=1, profile="P2", process_rpm=0.016)))
    beside = replace(Term.of(CATALOGUE["external_torque"], (0.0367, 0.0, 0.0)), values=(-0.05, -0.036))
    fit = base.refitted(base.model.with_terms(beside))
    (term,) = fit.model.terms
    assert abs(term.size - 0.07) < 0.002
    assert abs(term.shape[0] - 0.0377) < 1.0e-4
    assert fit.likelihood.value > base.likelihood.value + 200.0


def test_a_noisy_base_is_fitted_in_its_deepest_valley() -> None:
    """On a sine at 4.3 rpm of noise the readings do not show the break-away; no fit from the truth is likelier."""
    case = case_called("healthy-054", 11)
    run = run_of(case)
    base = prepare(source_of([log_of(case, run)]), None, None, "blocks").base
    wheel = case.wheel
    truth = Model(FrictionParameters(wheel.motor_gain, wheel.viscous, wheel.coulomb, wheel.static), base.model.stribeck)
    path = Trajectory.of_speed(run.speed_rad_s, np.full(run.speed_rad_s.size, 0.02))
    best = fit_model(base.linearised.record, truth, base.prior, path, base.noise, base.omit)
    assert base.likelihood.value > best.likelihood.value - 1.0
    assert abs(base.model.parameters.static - wheel.static) < 3.0 * base.std[3]
