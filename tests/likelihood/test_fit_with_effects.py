"""Coefficients of effects fitted to whole logs of a plant that shares no code with the estimator."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.course.conditions import with_conditions
from rw_ekf.course.course import Course
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.filter.belief import DEFAULT_PRIOR, Belief
from rw_ekf.identify.least_squares import LeastSquaresResult, least_squares
from rw_ekf.likelihood.log_fit import LogFit, consistency_of_fit, fit_log
from rw_ekf.model.effect import Shape, Term
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.effect_table import EffectSet
from tests.diagnosis.simulated import simulated
from tools.measure.runs import constants_for

# effect as the plant is told, true coefficient, where the fit starts, how far off that may be, shape
CASES: dict[str, tuple[str, float, float, float, Shape]] = {
    "offset_torque": ("torque_rad_s2=0.03", 0.03, 0.0, 0.1, (0.0, 0.0, 0.0)),
    "viscous_asymmetry": ("difference_1_s=0.0006", 0.0006, 0.0, 0.002, (0.0, 0.0, 0.0)),
    "transport_delay": ("delay_s=0.12", 0.12, 0.05, 0.1, (0.0, 0.0, 0.0)),
    "actuator_lag": ("time_constant_s=0.15", 0.15, 0.4, 0.3, (0.0, 0.0, 0.0)),
    "presliding_hysteresis": ("deflection_rad=0.05,damping=0.3", 0.05, 0.04, 0.03, (0.3, 0.0, 0.0)),
}


def course_of(effect: str, seed: int, process_rpm: float) -> Course:
    """A run of profile P2 with the effect of CASES, 1 rpm of noise."""
    run = simulated([f"{effect}:{CASES[effect][0]}"], seed=seed, profile="P2", process_rpm=process_rpm)
    return with_conditions(Course.of(run.time_s, run.measured_speed_rad_s, run.current_command_A))


def prior_of(effects: EffectSet) -> Belief:
    """The default prior on the parameters, and the terms' own values and standard deviations."""
    known = 4 + effects.size
    covariance = np.zeros((known, known))
    covariance[:4, :4] = DEFAULT_PRIOR.parameter_covariance
    covariance[4:, 4:] = np.diag([std**2 for term in effects.terms for std in term.stds])
    return Belief.of_known((*CK13_STATISTICAL, *effects.values), covariance, effects.table().size)


def both_fits(course: Course, effects: EffectSet) -> tuple[LeastSquaresResult, LogFit]:
    """Least squares, and from there the fit with torque noise in the weights, as the command does."""
    constants, prior = constants_for(), prior_of(effects)
    first = least_squares(course, constants, prior, effects)
    start = effects.with_values(first.coefficients, first.std[4:])
    return first, fit_log(course, constants, prior, first.parameters, start, effort="most")


@pytest.mark.parametrize("effect", CASES)
def test_least_squares_finds_the_coefficient_where_no_torque_is_missing(effect: str) -> None:
    """From a start far off, in three runs: within three sigmas, converged, nothing but the readings' noise left."""
    _, truth, start, std, shape = CASES[effect]
    effects = EffectSet((Term.of(CATALOGUE[effect], shape, start, std),))
    for seed in range(3):
        found = least_squares(course_of(effect, seed, 0.0), constants_for(), prior_of(effects), effects)
        assert found.converged
        assert abs(found.coefficients[0] - truth) < 3.0 * found.std[4] < 0.6 * truth
        assert found.residual_rms_rad_s == pytest.approx(RAD_S_PER_RPM, rel=0.06)


@pytest.mark.parametrize("effect", CASES)
def test_sigmas_of_coefficients_hold_for_a_speed_that_wanders(effect: str) -> None:
    """With torque noise the errors of all five numbers are about one in their sigmas, and nothing but noise is left."""
    _, truth, start, std, shape = CASES[effect]
    effects = EffectSet((Term.of(CATALOGUE[effect], shape, start, std),))
    errors = []
    for seed in range(4):
        _, found = both_fits(course_of(effect, seed, 0.03), effects)
        errors.append((np.array([*found.parameters, *found.effects.values]) - [*CK13_STATISTICAL, truth]) / found.std)
        assert found.std[4] < 0.2 * truth
        assert consistency_of_fit(found, constants_for()).is_noise is True
    normalised = np.array(errors)
    assert np.max(np.abs(normalised[:, 4])) < 3.0
    assert 0.4 < float(np.sqrt(np.mean(normalised**2))) < 1.6


def test_a_coefficient_known_for_certain_to_be_nothing_changes_nothing() -> None:
    """An offset held at zero: four parameters and their sigmas as without effects, in both fits."""
    course = course_of("viscous_asymmetry", 3, 0.05)
    held = EffectSet((Term.of(CATALOGUE["offset_torque"], std=1.0e-9),))
    bare, fixed = (
        [(np.array(fit.parameters), fit.std[:4]) for fit in both_fits(course, effects)]
        for effects in (EffectSet(), held)
    )
    for (expected, std), (found, found_std) in zip(bare, fixed, strict=True):
        assert np.max(np.abs((found - expected) / std)) < 1.0e-3
        assert found_std == pytest.approx(std, rel=1.0e-3)


@pytest.mark.parametrize("seed", [3, 9])
def test_a_fit_ends_where_its_steps_vanish(seed: int) -> None:
    """A passing trajectory was likelier than the one the model asks for: the fit goes on from there, and converges.

    To a fifth of a sigma: the variance of what flowed before the record goes with the lag, and no step knows of that.
    """
    _, truth, start, std, shape = CASES["actuator_lag"]
    effects = EffectSet((Term.of(CATALOGUE["actuator_lag"], shape, start, std),))
    _, found = both_fits(course_of("actuator_lag", seed, 0.03), effects)
    assert found.converged
    assert np.max(np.abs(found.noises.correction) / np.sqrt(np.diag(found.noises.covariance))) < 0.2
    assert abs(found.effects.values[0] - truth) < 3.0 * found.std[4]
