"""Laws as a filter carries them on: one curve and one amplitude, and none of a law that is nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.effects.catalogue import LEARNED
from rw_ekf.likelihood.law_as_amplitude import carried
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.model.effect import Term
from rw_ekf.model.friction import GAUSS, Stribeck
from rw_ekf.model.law import Law
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.wheel.effect_table import EffectSet

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
