"""Fits that must not end in the wrong valley: of an effect that is much larger than noise, and of a noisy base."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import fit_model
from rw_ekf.likelihood.gauss_newton import Start
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import Trajectory
from rw_ekf.model.effect import Term
from rw_ekf.model.state import CK13_STATISTICAL, FrictionParameters
from rw_ekf.units import RAD_S_PER_RPM
from tests.diagnosis import simulated as plant
from tests.diagnosis.simulated import fitted, record_of, simulated
from tools.proof.marks import case_called
from tools.proof.plants import log_of, run_of
from tools.proof.uncatalogued_laws import Nameless


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
    best = fit_model(base.problem, Start(truth, path, base.noise))
    assert base.likelihood.value > best.likelihood.value - 1.0
    assert abs(base.model.parameters.static - wheel.static) < 3.0 * base.std[3]


def test_a_part_that_has_nothing_of_an_effect_does_not_refuse_it() -> None:
    """Half of a sine's blocks pass the bump hardly at all; verdict and probabilities say the same."""
    run = simulated(["drag_bump:amplitude_rad_s2=0.0587,speed_rad_s=6.28,width_rad_s=1.57"], seed=5013, profile="S2")
    verdict = diagnose_log(plant.log_of(run)).document()["verdict"]
    assert verdict["effects"] == ["drag_bump"]
    assert verdict["posterior"]["drag_bump"] > 0.9


def test_a_step_cut_short_takes_along_what_goes_with_it() -> None:
    """A bump that begins half as wide as it is ends where one from the truth does, and as likely."""
    run = simulated(["drag_bump:amplitude_rad_s2=0.06,speed_rad_s=90,width_rad_s=12"], seed=41)
    base = fitted(record_of(run))
    bump = CATALOGUE["drag_bump"]
    fits = [
        base.refitted(base.model.with_terms(replace(Term.of(bump, (90.0, width, 0.0)), values=(size,))))
        for size, width in ((0.114, 6.0), (0.06, 12.0))
    ]
    assert fits[0].likelihood.value > fits[1].likelihood.value - 1.0
    assert abs(fits[0].model.terms[0].shape[1] - fits[1].model.terms[0].shape[1]) < 0.5


def test_a_verdict_that_names_nothing_says_what_speaks_against_it() -> None:
    """A drag too weak to be named is told with its probability: nothing is settled."""
    verdict = diagnose_log(log_of(case_called("p12-1rpm-002", 11))).document()["verdict"]
    assert verdict["kind"] == "adequate"
    assert max(verdict["posterior"].values()) == verdict["posterior"]["none"] < 0.8
    assert "the probability that nothing is missing is" in verdict["statement"]
    assert "quadratic_drag is not significant" in verdict["statement"]


def test_a_break_away_that_was_lost_is_found_again() -> None:
    """A wheel that passes zero and never rests, from a fit that says it takes nothing to start."""
    case = Nameless("healthy", 11)
    base = prepare(source_of([case.log()]), None, None, "blocks").base
    lost = replace(base.model, parameters=base.model.parameters._replace(static=-0.003))
    fit = base.refitted(lost)
    assert fit.below_coulomb < 2.0
    assert fit.likelihood.value > base.likelihood.value - 1.0
    assert abs(fit.model.parameters.static - CK13_STATISTICAL.static) < 3.0 * fit.std[3]


@pytest.mark.slow
def test_a_base_fit_that_took_the_wheel_for_one_that_never_sticks_begins_anew() -> None:
    """Bursts and rests, viscous friction that differs by 80 %: least squares breaks the wheel away at .09 of .57."""
    rng, rate_hz, samples = np.random.default_rng(83), 20.0, 8000
    wheel = PlantParameters()._replace(motor_gain=19.3, viscous=0.0032, coulomb=0.475, static=0.571)
    hold_A = wheel.coulomb / wheel.motor_gain
    current_A, i = np.zeros(samples), 0
    while i < samples:
        burst = int(rng.uniform(2.0, 8.0) * rate_hz)
        current_A[i : i + burst] = rng.uniform(1.1 * hold_A, 0.25) * rng.choice([-1.0, 1.0])
        i += burst
        if rng.random() < 0.5:
            rest = int(rng.uniform(2.0, 6.0) * rate_hz)
            current_A[i : i + rest] = rng.uniform(0.0, 0.9) * hold_A * rng.choice([-1.0, 1.0])
            i += rest
        i += int(rng.uniform(10.0, 60.0) * rate_hz)
    effects = parse_effects(["viscous_asymmetry:difference_1_s=-0.0025"], wheel)
    run = simulate_run(effects, current_A, np.arange(samples) / rate_hz, PlantNoise(RAD_S_PER_RPM, 0.0), seed=83)
    document = diagnose_log(plant.log_of(run)).document()
    static = document["parameters"]["before"]["static"]
    assert abs(static["value"] - wheel.static) < 0.05
    assert document["verdict"]["effects"] == ["viscous_asymmetry"]
    assert document["verdict"]["indistinguishable"] == []
    found = document["candidates"][0]["parameters"]["difference_1_s"]
    assert abs(found["value"] + 0.0025) < 2.5 * found["std"]
