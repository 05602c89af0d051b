"""Effects in the printed C: the same bits as the estimator for each, and a refusal in one sentence for the rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rw_ekf.effects.catalogue import CATALOGUE, FORMULAS
from rw_ekf.errors import BadInputError
from rw_ekf.model.effect import Term
from rw_ekf.model.effect_kinds import CurrentEffect, DelayEffect, FrictionMemoryEffect, WindowEffect
from rw_ekf.model.law import Law
from rw_ekf.wheel.effect_table import EffectSet
from tests.filter.effect_replay import believed, both, in_use, rough_log
from tests.filter.replay import OUTCOMES
from tests.flight.c_library import compiled, in_c, needs_gcc, same_bits, setup_for
from tests.flight.own_formulas import OWN, own_effects
from tools.measure.runs import constants_for

_REFUSED = (CurrentEffect, FrictionMemoryEffect, DelayEffect, WindowEffect)
_PRINTED = [effect.id for effect in FORMULAS if not issubclass(effect, _REFUSED)]


def _law(quantity: str, acts_as: str, first: float, last: float) -> EffectSet:
    rng = np.random.default_rng(7)
    scale = {"motor_gain": 0.05, "current_loss": 0.001, "viscous_drag": 1.0e-4, "windage": 1.0e-6}.get(acts_as, 0.02)
    functions = tuple(tuple(scale * rng.normal(size=9)) for _ in range(2))
    law = Law(quantity, acts_as, first, last, functions)  # type: ignore[arg-type]
    return EffectSet((Term(CATALOGUE["learned_law"], (1.0, -0.5), (0.3, 0.3), law=law),))


@needs_gcc
@pytest.mark.parametrize("name", _PRINTED)
def test_each_effect_has_the_bits_of_the_estimator(name: str, tmp_path: Path) -> None:
    """Every mean and variance of every effect that is printed, on a rough log, as the online estimator has them."""
    _assert_same_bits(in_use(name), tmp_path)


@needs_gcc
@pytest.mark.parametrize(
    ("quantity", "acts_as", "first", "last"),
    [
        ("speed", "drag", -60.0, 60.0),
        ("speed_size", "windage", 0.0, 60.0),
        ("angle", "torque", 0.0, 6.283185307179586),
        ("current_size", "motor_gain", 0.0, 0.15),
        ("current_along_motion", "current_loss", -0.15, 0.15),
        ("temperature", "viscous_drag", 15.0, 30.0),
        ("time", "torque", 0.0, 70.0),
    ],
)
def test_learned_laws_have_the_bits_of_the_estimator(
    quantity: str, acts_as: str, first: float, last: float, tmp_path: Path
) -> None:
    """Laws over each quantity, acting in each way."""
    _assert_same_bits(_law(quantity, acts_as, first, last), tmp_path)


@needs_gcc
def test_several_effects_at_once(tmp_path: Path) -> None:
    """A switch over the effects of the model, and a code of no other."""
    effects = EffectSet((*in_use("quadratic_drag", "offset_torque", "viscous_temperature").terms,
                         *_law("speed", "drag", -60.0, 60.0).terms))  # fmt: skip
    _assert_same_bits(effects, tmp_path)
    text = (tmp_path / "rw_ekf.c").read_text()
    assert "quadratic_drag_contribution" in text
    assert "drag_spike" not in text


@needs_gcc
@pytest.mark.parametrize("name", OWN)
def test_formulas_of_ones_own_have_the_bits_of_the_estimator(name: str, tmp_path: Path) -> None:
    """Written out step by step, they are what the filter runs as a program; nothing of a program is in the C."""
    _assert_same_bits(own_effects(tmp_path, name), tmp_path)
    text = (tmp_path / "rw_ekf.c").read_text()
    assert "own_formula_1" in text
    assert "law_values" not in text


@needs_gcc
def test_formulas_beside_a_law_and_an_effect(tmp_path: Path) -> None:
    """Each is told from the other and from a learned law by its place in the table."""
    effects = EffectSet((*in_use("quadratic_drag").terms, *own_effects(tmp_path, "ripple").terms,
                         *_law("speed", "drag", -60.0, 60.0).terms, *own_effects(tmp_path, "eddy").terms))  # fmt: skip
    _assert_same_bits(effects, tmp_path)


def test_what_cannot_be_printed_is_refused_by_name() -> None:
    """A lag, a friction with a memory, a delay, a window: a sentence that names the effect."""
    for effect in FORMULAS:
        if issubclass(effect, _REFUSED):
            effects = in_use(effect.id)
            with pytest.raises(BadInputError, match=effect.id):
                setup_for(constants_for(), believed(effects), effects)


@needs_gcc
def test_a_temperature_that_acts_late_has_the_bits_of_the_estimator(tmp_path: Path) -> None:
    """The lag is a constant of the model, and the compiled pass over a log has the same."""
    effects = in_use("viscous_temperature", "coulomb_temperature")
    _assert_same_bits(effects, tmp_path, temperature_lag_s=3.0)
    log, temperature, angle = rough_log(5)
    results, run = both(log, temperature, angle, effects, 3.0)
    found = np.array([result.values for result in results])
    assert run.states[:, : found.shape[1]] == pytest.approx(found, rel=1e-9, abs=1e-12)
    assert found != pytest.approx(np.array([r.values for r in both(log, temperature, angle, effects)[0]]), rel=1e-6)


@needs_gcc
@pytest.mark.parametrize("wild", [np.inf, -np.inf])
@pytest.mark.parametrize("temperature_lag_s", [0.0, 3.0])
def test_an_infinite_condition_is_a_missing_one(wild: float, temperature_lag_s: float, tmp_path: Path) -> None:
    """Of the temperature or of the angle, once: what follows has the bits of a reading that was not there at all."""
    effects = in_use("viscous_temperature", "torque_ripple")
    log, temperature, angle = rough_log(5)
    belief = believed(effects)
    constants = constants_for()._replace(temperature_lag_s=temperature_lag_s)
    library = compiled(tmp_path, setup_for(constants, belief, effects, np.full(effects.size, 1.0e-9)))
    readings = {}
    for value in (wild, np.nan):
        warmth, turned = temperature.copy(), angle.copy()
        warmth[warmth.size // 2] = turned[turned.size // 3] = value
        results, _ = both(log, warmth, turned, effects, temperature_lag_s)
        online = np.array([result.values for result in results])
        found = in_c(library, log, len(belief.mean), warmth, turned)
        assert same_bits(found.mean[:, : online.shape[1]], online)
        readings[value] = online
    assert np.isfinite(readings[wild]).all()
    assert same_bits(readings[wild], readings[np.nan])


def _assert_same_bits(effects: EffectSet, folder: Path, temperature_lag_s: float = 0.0) -> None:
    log, temperature, angle = rough_log(5)
    belief = believed(effects)
    drift = np.full(effects.size, 1.0e-9)
    results, _ = both(log, temperature, angle, effects, temperature_lag_s)
    constants = constants_for()._replace(temperature_lag_s=temperature_lag_s)
    library = compiled(folder, setup_for(constants, belief, effects, drift))
    found = in_c(library, log, len(belief.mean), temperature, angle)
    assert [OUTCOMES[code] for code in found.outcome] == [result.outcome for result in results]
    shown = len(results[0].values)
    assert same_bits(found.mean[:, :shown], np.array([result.values for result in results]))
    covariances = np.array([result.covariance for result in results])
    assert same_bits(found.covariance, covariances)
