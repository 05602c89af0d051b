"""How well the numbers of an effect are known, and which of its valleys they are of."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

import rw_ekf
from rw_ekf.diagnosis.hypotheses.other_starts import in_deepest_valleys
from rw_ekf.diagnosis.hypotheses.selection import Selection, Trial
from rw_ekf.diagnosis.investigate.sigmas import (
    with_free_shapes,
    with_open_noise,
    with_possible_break_away,
    with_profiled_widths,
)
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.preparation import Prepared, prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit, fit_model
from rw_ekf.likelihood.gauss_newton import Start
from rw_ekf.model.effect import Term
from tests.diagnosis.simulated import log_of, simulated
from tools.measure.effect_coverage import drawn, reported
from tools.proof.plants import log_of as log_of_case

BRISTLE, SPIKE = CATALOGUE["presliding_hysteresis"], CATALOGUE["drag_spike"]
OFFSET = CATALOGUE["offset_torque"]
DEFLECTION_RAD, DAMPING = 0.03, 0.45


@lru_cache
def prepared_with_bristle() -> Prepared:
    """A wheel on a bristle, five minutes of it."""
    effect = f"presliding_hysteresis:deflection_rad={DEFLECTION_RAD},damping={DAMPING}"
    return prepare(source_of([log_of(simulated([effect], seed=21, samples=3000))]), None, None, "blocks")


def fit_from(prepared: Prepared, deflection_rad: float, damping: float, turns: int) -> Fit:
    """The record fitted with a bristle from one place."""
    base = prepared.base
    model = base.model.with_terms(Term.of(BRISTLE, (damping, 0.0, 0.0), deflection_rad))
    return fit_model(base.problem._replace(record=prepared.record), Start(model, base.trajectory, base.noise), turns)


def test_a_bristle_leaves_a_wrong_valley_for_the_deepest() -> None:
    """A fit that was stopped at a fifth of the deflection and of the damping ends at the plant's, within 4 sigma."""
    prepared = prepared_with_bristle()
    misled = fit_from(prepared, 0.2 * DEFLECTION_RAD, 0.2 * DAMPING, turns=1)
    trial = Trial(BRISTLE, 0.0, 1.0, 0.0, 0.0, 0.0)
    begun = Selection(prepared.base, misled, trials={BRISTLE.id: trial})
    selection = in_deepest_valleys(begun, prepared.facts)
    found = selection.final.terms_of(BRISTLE.id)[0]
    assert selection.final.likelihood.value > misled.likelihood.value + 10.0
    assert abs(found.term.values[0] - DEFLECTION_RAD) < 4.0 * float(found.covariance[0, 0]) ** 0.5
    assert abs(found.term.shape[0] - DAMPING) < 4.0 * found.shape_std["damping"]
    gained = 2.0 * (selection.final.likelihood.value - misled.without(BRISTLE.id).likelihood.value)
    assert selection.trials[BRISTLE.id].statistic == pytest.approx(gained, abs=1.0)


def test_a_sigma_is_no_smaller_than_the_profile_is_wide() -> None:
    """A covariance a thousand times too small gives way to the profile, whose width is that of the curvature here."""
    fit = fit_from(prepared_with_bristle(), DEFLECTION_RAD, DAMPING, turns=8)
    tiny = replace(fit, likelihood=replace(fit.likelihood, covariance=1.0e-3 * fit.likelihood.covariance))
    widened = with_profiled_widths(tiny, BRISTLE.id)
    at = fit.model.known - 1
    assert widened.std[: at - 1] == pytest.approx(tiny.std[: at - 1])  # the parameters' are not touched
    for place in (at, at + 1):
        assert 0.5 * fit.std[place] < widened.std[place] < 2.0 * fit.std[place]


def test_a_torque_noise_that_is_hardly_seen_makes_sigmas_wider_and_one_that_is_seen_does_not() -> None:
    """An offset's sigma grows where no torque noise was found, and stays within 15 % where there is plenty."""
    ratios = []
    for process_rpm in (0.0, 0.3):
        log = log_of(simulated(["offset_torque:torque_rad_s2=0.05"], seed=13, process_rpm=process_rpm))
        base = prepare(source_of([log]), None, None, "blocks").base
        fit = base.refitted(base.model.with_terms(Term.of(OFFSET)))
        place = fit.model.known - 1
        ratios.append(float(with_open_noise(fit).std[place] / fit.std[place]))
    assert ratios[0] > 1.15
    assert ratios[1] == pytest.approx(1.0, abs=0.15)


def test_a_spike_is_told_with_what_its_onset_and_decay_leave_open() -> None:
    """A settled spike's amplitude is as uncertain as that of one whose shape is fitted, and so are onset and decay."""
    run = simulated(["drag_spike:amplitude_rad_s2=0.1,onset_s=150,decay_s=60"], seed=5, profile="P2", samples=3000)
    prepared = prepare(source_of([log_of(run)]), None, None, "blocks")
    free = prepared.base.refitted(prepared.base.model.with_terms(Term.of(SPIKE, (150.0, 60.0, 0.0), 0.1)))
    settled = free.refitted(free.model.settled(SPIKE.id))
    widened = with_free_shapes(settled, SPIKE.id)
    at = free.model.known - 1
    assert widened.std[at] > 1.3 * settled.std[at]
    assert widened.std[at:] == pytest.approx(free.std[at:], rel=0.1)
    assert widened.model.vector[at] == settled.model.vector[at]


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "least_std_s", "most_std_s"), [(332, 0.1, 1.0), (321, 0.5, 2.0)])
def test_an_onset_is_found_behind_a_reversal_and_as_open_as_two_places_are_apart(
    seed: int, least_std_s: float, most_std_s: float
) -> None:
    """One spike was told 12 sigma off, on the wrong side of a reversal; one has two places that are nearly alike."""
    what = drawn("drag_spike", seed)
    document = diagnose_log(log_of_case(what.case)).document()
    entry = next(item for item in document["candidates"] if item["effect"] == "drag_spike")
    found = reported({"found": entry["parameters"], "truth": what.truth})
    assert least_std_s < found["onset_s"][1] < most_std_s
    for number in ("onset_s", "amplitude_rad_s2", "decay_s"):
        value, std, truth = found[number]
        assert abs(value - truth) < 2.5 * std


@pytest.mark.slow
def test_a_law_that_is_hardly_told_from_another_leaves_the_speed_open() -> None:
    """Gauss's law at 5 % of Coulomb friction looks like Lorentz's: both are told, and the sigma spans both speeds."""
    what = drawn("stribeck_shape", 210)
    document = diagnose_log(log_of_case(what.case)).document()
    entry = next(item for item in document["candidates"] if item["effect"] == "stribeck_shape")
    chances = entry["parameters"]["law"]["probability"]
    assert chances["gauss"] > 0.02
    assert sum(chances.values()) == pytest.approx(1.0, abs=0.05)
    speed = entry["parameters"]["speed_rad_s"]
    assert speed["std"] > 0.12  # 0.07 by the likeliest law alone
    assert "its law may also be" in document["verdict"]["statement"]


def test_a_break_away_below_coulomb_friction_is_known_no_better_than_it_is_below() -> None:
    """No bearing has it; one above keeps its sigma, as every other number does."""
    log = rw_ekf.simulate("P1", seed=3, duration_s=120.0)
    base = prepare(source_of([log]), None, None, "blocks").base
    assert np.array_equal(with_possible_break_away(base).std, base.std)
    known = base.model.parameters
    low = replace(base, model=replace(base.model, parameters=known._replace(static=0.9 * known.coulomb)))
    assert low.below_coulomb > 3.0
    ratios = with_possible_break_away(low).std / low.std
    assert ratios == pytest.approx([1.0, 1.0, 1.0, low.below_coulomb])
