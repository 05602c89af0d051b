"""The curve of a named cause: its law as the catalogue has it, the measured points about it, for every effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.diagnosis.report.binning import binned_means
from rw_ekf.diagnosis.report.cause_curve import cause_curves
from rw_ekf.diagnosis.report.curves import Curve
from rw_ekf.diagnosis.report.template_engine import prose_parts
from rw_ekf.diagnosis.report.words import Units
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.effects.catalogue import CATALOGUE, FORMULAS
from rw_ekf.model.effect import Term
from rw_ekf.wheel.effect_table import EffectSet
from tests.diagnosis.example import INERTIA_KG_M2, example

pytestmark = pytest.mark.xdist_group("report")

UNITS = Units(wheel=True, inertia_kg_m2=INERTIA_KG_M2)


def named(effect: str, term: Term | None) -> list[Curve]:
    """The curves where this effect is named, and this term is in the model."""
    found = example(seed=1)
    assert found.model is not None
    model = found.model if term is None else replace(found.model, effects=EffectSet((term,)))
    content = {**found.document(), "verdict": {"kind": "effect", "effects": [effect]}}
    return cause_curves(replace(found, content=content, model=model), UNITS)


def test_friction_against_temperature_is_a_line_among_what_was_measured() -> None:
    """Slope times viscous friction at the usual speed, per kelvin; points lie about it by their own errors."""
    slope = -0.03
    (curve,) = named("viscous_temperature", Term.of(CATALOGUE["viscous_temperature"], value=slope))
    found = example(seed=1)
    assert found.model is not None
    assert curve.law_x is not None
    assert curve.law_y is not None
    usual = float(np.sqrt(np.mean(found.log.speed_rad_s**2)))
    per_kelvin = 1.0e3 * INERTIA_KG_M2 * slope * found.model.parameters.viscous * usual
    assert np.polyfit(curve.law_x, curve.law_y, 1)[0] == pytest.approx(per_kelvin, rel=1e-6)
    misses = (curve.y - np.interp(curve.x, curve.law_x, curve.law_y)) / curve.error
    assert np.mean(np.abs(misses) < 1.0) > 0.8
    assert "additional drag at" in curve.y_label
    assert curve.x_label == "temperature [°C]"


def test_waves_within_a_turn_are_laid_over_each_other() -> None:
    """A ripple of 36 periods a turn is drawn over one of them, with its whole amplitude."""
    (curve,) = named("torque_ripple", Term.of(CATALOGUE["torque_ripple"], (36.0, 0.0, 0.0), value=0.05))
    assert curve.law_x is not None
    assert curve.law_y is not None
    assert curve.law_x.max() == pytest.approx(10.0)
    # Two coefficients of 0.05, a sine and a cosine.
    assert np.abs(curve.law_y).max() == pytest.approx(1.0e3 * INERTIA_KG_M2 * 0.05 * np.sqrt(2.0), rel=1e-3)
    assert "one of 36 periods" in curve.x_label


@pytest.mark.parametrize("effect", sorted(effect.id for effect in FORMULAS))
def test_every_effect_of_the_catalogue_is_drawn(effect: str) -> None:
    """A curve with its errors for each that is a function of something, in the model by a term or not."""
    for term in (None, Term.of(CATALOGUE[effect], (1.0, 1.0, 1.0), value=1.0e-3)):
        curves = named(effect, term)
        assert len(curves) == (1 if CATALOGUE[effect].shown_against else 0)
        for curve in curves:
            assert curve.x.size == curve.y.size == curve.error.size > 1
            assert np.isfinite(curve.y).all()


def test_nothing_is_drawn_without_a_model_before_and_after() -> None:
    """One model alone has nothing to be compared with."""
    found: Diagnosis = example(seed=1)
    assert cause_curves(replace(found, after=None), UNITS) == []


def test_means_per_lever_are_least_squares() -> None:
    """A coefficient that differs by bin comes back with an honest error, whatever the sign and size of its lever."""
    rng = np.random.default_rng(1)
    x, lever = rng.uniform(0.0, 1.0, 20_000), rng.standard_normal(20_000)
    y = (1.0 + (x > 0.5)) * lever + rng.standard_normal(x.size)
    found = binned_means(x, y, np.ones(x.size, bool), np.array([0.0, 0.5, 1.0]), 1.0, lever)
    np.testing.assert_allclose(found.mean, [1.0, 2.0], atol=0.04)
    np.testing.assert_allclose(found.standard_error, 0.01, rtol=0.05)


def test_code_in_a_sentence_is_told_from_words() -> None:
    """Pairs of backticks mark code, a single one is none; signs stand for their spelling."""
    assert prose_parts("use `a b`, 1 +- 2 -> 3") == [(False, "use "), (True, "a b"), (False, ", 1\xa0±\xa02 → 3")]
    assert prose_parts("one ` alone") == [(False, "one ` alone")]
