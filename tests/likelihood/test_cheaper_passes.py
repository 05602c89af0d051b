"""What a pass costs less: laws as the curves that they are, slopes by the speed without differences, bases by QR."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array, spanning
from rw_ekf.course.course import Course
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.filter.constants import filter_constants
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import Prediction, Record, Trajectory, predict
from rw_ekf.model.effect import Term
from rw_ekf.model.friction import Stribeck
from rw_ekf.model.law import Law
from rw_ekf.model.state import FrictionParameters
from rw_ekf.wheel.effect_table import EffectSet

_SAMPLES, _PERIOD_S = 4000, 0.02
_PARAMETERS = FrictionParameters(30.0, 0.01, 0.6, 0.7)
_STRIBECK = Stribeck(2.0, 0)


def _speed(shift_rad_s: float = 0.0) -> Float64Array:
    time_s = np.arange(_SAMPLES) * _PERIOD_S
    return np.asarray(90.0 * np.sin(0.3 * time_s) + 7.0 * np.sin(1.7 * time_s) + shift_rad_s)


def _record() -> Record:
    time_s, speed = np.linspace(0.0, (_SAMPLES - 1) * _PERIOD_S, _SAMPLES), _speed()
    course = Course.of(time_s, speed, np.where(np.cos(0.3 * time_s) > 0.0, 0.3, -0.3))
    turned = np.cumsum(speed) * _PERIOD_S
    return Record.of(course._replace(angle_rad=turned), np.ones(_SAMPLES, bool), filter_constants(1.0))


def _law(rng: np.random.Generator, quantity: str, first: float, last: float) -> Term:
    functions = tuple(tuple(rng.normal(0.0, 0.02, 31).tolist()) for _ in range(9))
    law = Law(quantity, "drag", first, last, functions, (1.0,) * 9)  # type: ignore[arg-type]
    return Term(CATALOGUE["learned_law"], tuple(rng.normal(size=9).tolist()), (0.1,) * 9, law=law)


def _predicted(model: Model, speed: Float64Array) -> Prediction:
    trajectory = Trajectory.of_speed(speed, np.full(_SAMPLES, 0.05))
    return predict(_record(), model.coefficients, model.effects, model.stribeck, trajectory)


@pytest.mark.parametrize(("quantity", "first", "last"), [("speed", -80.0, 70.0), ("angle", 0.0, 2.0 * np.pi)])
def test_a_law_as_the_curve_that_it_is_predicts_the_same(quantity: str, first: float, last: float) -> None:
    """Nine functions with coefficients, and their sum with a coefficient of one, beyond the knots too."""
    terms = (_law(np.random.default_rng(5), quantity, first, last), Term.of(CATALOGUE["actuator_lag"], value=0.004))
    model = Model(_PARAMETERS, _STRIBECK, EffectSet(terms))
    assert model.with_laws_as_curves.effects.size == 2
    whole, curve = _predicted(model, _speed()), _predicted(model.with_laws_as_curves, _speed())
    assert np.max(np.abs(whole.end - curve.end)) < 1.0e-12
    assert np.max(np.abs(whole.slopes - curve.slopes)) < 1.0e-12


@pytest.mark.parametrize(
    ("effect", "value"), [("actuator_lag", 0.004), ("transport_delay", 0.013), ("speed_averaging", 0.03)]
)
def test_slopes_by_the_speed_are_those_of_predictions_from_another_speed(effect: str, value: float) -> None:
    """Where the current is late or readings are means over a window, against differences of two predictions."""
    model = Model(_PARAMETERS, _STRIBECK, EffectSet((Term.of(CATALOGUE[effect], value=value),)))
    h, speed = 1.0e-3, _speed()
    here, up, down = (_predicted(model, _speed(shift)) for shift in (0.0, h, -h))
    far = np.abs(speed[:-1]) > 20.0 * _STRIBECK.omega_s
    differences = ((up.end - down.end) / (2.0 * h))[1:][far]
    assert differences.size > 1000
    assert np.max(np.abs(here.slopes[1:, 0][far] - differences)) < 1.0e-8


def test_a_basis_spans_what_its_columns_do_and_no_more() -> None:
    """Beside numpy's singular vectors, for columns of very different sizes, two that are one, and one of zeros."""
    rng = np.random.default_rng(2)
    rows = rng.normal(size=(500, 6)) * np.array([1.0, 1.0e-3, 1.0, 1.0e-6, 1.0, 0.0])
    rows[:, 4] = 2.0 * rows[:, 0]
    basis = spanning(rows)
    left, sizes, _ = np.linalg.svd(rows, full_matrices=False)
    known = left[:, sizes > 1.0e-8 * sizes[0]]
    assert basis.shape == known.shape == (500, 4)
    assert np.max(np.abs(basis.T @ basis - np.eye(4))) < 1.0e-8
    assert np.max(np.abs(basis @ basis.T - known @ known.T)) < 1.0e-8
