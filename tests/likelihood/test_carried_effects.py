"""Effects as a filter carries them on: a law as one curve and one amplitude, and what it considers and never learns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.effects.catalogue import CATALOGUE, LEARNED
from rw_ekf.likelihood.carried_effects import carried
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.model.effect import Term
from rw_ekf.model.friction import GAUSS, Stribeck
from rw_ekf.model.law import Law
from rw_ekf.model.moment import Moment
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.wheel.effect_table import EffectSet
from rw_ekf.wheel.momentary_friction import FrictionTorque, friction_of

FUNCTIONS = ((1.0, 0.0, -1.0), (0.0, 1.0, 0.0))
LAW = Law("speed_size", "drag", 0.0, 100.0, FUNCTIONS, (1.0, 1.0))


def model_with(*values: tuple[float, float]) -> Model:
    laws = (LAW, replace(LAW, quantity="current_size"))
    terms = tuple(Term(LEARNED, pair, (0.0, 0.0), law=law) for pair, law in zip(values, laws, strict=False))
    return Model(CK13_STATISTICAL, Stribeck(0.4, GAUSS), EffectSet(terms))


def test_the_amplitude_is_one_and_as_uncertain_as_least_squares_makes_it() -> None:
    """v = (3, 4) with variances 1 and 4: var a = 1 / (9/1 + 16/4)."""
    covariance = np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 4.0])
    effects, found = carried(model_with((3.0, 4.0)), covariance)
    (term,) = effects.terms
    assert term.values == (1.0,)
    assert term.law is not None
    assert term.law.functions[0] == pytest.approx((3.0, 4.0, -3.0))
    assert found[-1, -1] == pytest.approx(1.0 / 13.0)


def test_a_law_that_is_nothing_throughout_is_left_out() -> None:
    """Its amplitude would be nought over nought, and no file with it could be read."""
    effects, found = carried(model_with((3.0, 4.0), (0.0, 0.0)), np.eye(8))
    assert len(effects.terms) == 1
    assert found.shape == (5, 5)
    assert np.all(np.isfinite(found))


BUMP = Term(CATALOGUE["drag_bump"], (0.08,), (0.0,), (60.0, 8.0, 0.0))
AT = Moment(0.0, 0.1, 20.0, 0.0, 0.0, 0.0)


def bump_and_law() -> tuple[Model, Float64Array]:
    """A bump with free place and width beside a law of the speed with two coefficients, all of them correlated."""
    model = Model(
        CK13_STATISTICAL, Stribeck(0.4, GAUSS), EffectSet((BUMP, Term(LEARNED, (0.03, 0.04), (0.0, 0.0), law=LAW)))
    )
    stds = np.array([0.01, 1e-5, 1e-3, 1e-3, 2e-3, 2e-3, 3e-3, 0.3, 0.4])
    root = np.eye(stds.size) + 0.3 * np.random.default_rng(4).normal(size=(stds.size, stds.size))
    normal = root @ root.T
    normal /= np.sqrt(np.outer(np.diag(normal), np.diag(normal)))
    return model, normal * np.outer(stds, stds)


def friction(model: Model, speed: float) -> float:
    table = model.effects.table()
    return friction_of([speed, *model.coefficients], table, model.stribeck, AT)


@pytest.mark.parametrize("speed", [20.0, 52.0, 60.0, 66.0, -71.0, 95.0])
def test_the_friction_is_as_uncertain_as_the_fit_left_it(speed: float) -> None:
    """Beside 4,000 draws of all that was fitted: on the flank of a bump, on its top, where the law alone is, behind it.

    Place, width and the law's shape are no states of the filter; their share is most of it at 52 rad/s.
    """
    model, covariance = bump_and_law()
    effects, learned = carried(model, covariance)
    draws = np.random.default_rng(7).multivariate_normal(model.vector, covariance, 4000)
    spread = float(np.std([friction(model.with_vector(draw), speed) for draw in draws]))
    x, P = np.array([speed, *model.parameters, *effects.values]), np.zeros((7, 7))
    P[1:, 1:] = learned
    found = FrictionTorque(x, P, effects.table(), model.stribeck, AT, effects, P).believed_rad_s2(speed)
    assert found.value == pytest.approx(friction(model, speed), rel=1e-9)
    assert found.std == pytest.approx(spread, rel=0.06)
    alone = FrictionTorque(x, P, effects.table(), model.stribeck, AT).believed_rad_s2(speed).std
    assert speed != 52.0 or found.std > 2.0 * alone


def test_what_was_never_learned_stays_open_when_the_rest_is_known() -> None:
    """With the learned numbers known for sure, what is left is what they do as a shape is off, and the shape itself."""
    model, covariance = bump_and_law()
    effects, learned = carried(model, covariance)
    x = np.array([66.0, *model.parameters, *effects.values])
    began = np.zeros((7, 7))
    began[1:, 1:] = learned
    torque = FrictionTorque(x, np.zeros((7, 7)), effects.table(), model.stribeck, AT, effects, began)
    known = torque.believed_rad_s2(66.0)
    steps = 1.0e-4 * np.sqrt(np.diag(covariance))
    slopes = [
        (friction(model.with_vector(model.vector + way), 66.0) - friction(model.with_vector(model.vector - way), 66.0))
        for way in np.diag(steps)
    ] / (2.0 * steps)
    shapes = slice(7, 9)
    # C_xr C_rr^-1 of the shapes alone bounds it from below: the law's own bend comes on top.
    along = slopes @ covariance[:, shapes] @ np.linalg.inv(covariance[shapes, shapes])
    least = float(np.sqrt(along @ covariance[shapes, shapes] @ along))
    assert least <= known.std * 1.02
    assert known.std**2 <= float(slopes @ covariance @ slopes) * 1.02
    assert learned.shape == (6, 6)


def test_nothing_is_considered_of_what_was_not_fitted() -> None:
    """A bump whose place came from elsewhere, and a law that is known."""
    settled = replace(BUMP, settled=True)
    model = Model(CK13_STATISTICAL, Stribeck(0.4, GAUSS), EffectSet((settled,)))
    effects, _ = carried(model, np.eye(5))
    assert effects.considered == ()
