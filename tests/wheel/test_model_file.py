"""Effects in a model file: what is written comes back to the last bit, what is wrong is told with its place."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.checking.yaml_text import yaml_text
from rw_ekf.effects.catalogue import CATALOGUE, FORMULAS
from rw_ekf.errors import ConfigError
from rw_ekf.learning.aged_model import carried_over
from rw_ekf.model.considered import CURVE_POINTS, Direction, Off
from rw_ekf.model.effect import NO_SHAPE, Shape, Term
from rw_ekf.model.law import Law
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.settings.schema import Configuration
from rw_ekf.starting_point import belief_of_model, model_of, setup_of_configuration, setup_of_start
from rw_ekf.wheel.effect_table import EffectSet
from rw_ekf.wheel.model_file import WheelModel, read_model

SHAPES: dict[str, Shape] = {
    "torque_ripple": (6.0, 0.1, 0.0),
    "external_torque": (1.0 / 7.0, -0.3, 12.0),
    "drag_spike": (123.4, 60.0, 0.0),
    "drag_bump": (61.2, 7.5, 0.0),
    "coulomb_drift": (300.0, 12.0, 0.0),
    "stribeck_shape": (1.0, 0.0, 0.0),
    "presliding_hysteresis": (0.3, 0.0, 0.0),
}


def effect(name: str, value: float = 0.03, std: float = 0.001, shape: Shape | None = None) -> Term:
    """A term as a diagnosis leaves it, of one coefficient."""
    return Term(CATALOGUE[name], (value,), (std,), SHAPES.get(name, NO_SHAPE) if shape is None else shape)


def pair(name: str, sine: float, cosine: float) -> Term:
    """A periodic effect of unknown phase."""
    return Term(CATALOGUE[name], (sine, cosine), (0.001, 0.001), SHAPES[name])


def model_with(*terms: Term) -> WheelModel:
    """A model with a full covariance, each number of it another."""
    effects = EffectSet(terms)
    size = 4 + effects.size
    root = np.random.default_rng(size).normal(size=(size, size))
    covariance = tuple(tuple(float(v) for v in row) for row in 1.0e-4 * root @ root.T + 1.0e-3 * np.eye(size))
    return WheelModel(
        parameters=CK13_STATISTICAL,
        covariance=covariance,
        stribeck_speed_rad_s=1.0 / 3.0,
        stribeck_law="tustin",
        speed_noise_rad_s=0.1,
        acceleration_noise=0.01,
        inertia_kg_m2=1.5e-3,
        source={"method": "diagnose"},
        effects=effects,
    )


def read_text(tmp_path: Path, text: str) -> WheelModel:
    """What a file of this text holds."""
    path = tmp_path / "model.yaml"
    path.write_text(text, encoding="utf-8")
    return read_model(path)


@pytest.mark.parametrize("name", [effect.id for effect in FORMULAS])
def test_every_effect_comes_back_as_it_was(tmp_path: Path, name: str) -> None:
    """Coefficient, sigma, constants and covariance survive the file to the last bit; a reading effect is no state."""
    model = model_with(effect(name, 1.0 / 3.0, 1.0 / 7.0))
    assert read_text(tmp_path, model.to_text()) == model
    assert len(model.covariance) == (4 if name == "speed_quantisation" else 5)


def test_several_effects_keep_their_order(tmp_path: Path) -> None:
    """Two lines of a ripple, a lag and a grid: the covariance's rows stay with the effects they belong to."""
    other = effect("torque_ripple", shape=(12.0, 0.0, 0.0))
    model = model_with(
        pair("torque_ripple", 0.1, 0.2), effect("speed_quantisation"), effect("actuator_lag"), other
    )  # fmt: skip
    read = read_text(tmp_path, model.to_text())
    assert read == model
    assert read.effects.state_names == ("torque_ripple", "torque_ripple_2", "actuator_lag", "torque_ripple_3")


def test_a_file_without_effects_has_none(tmp_path: Path) -> None:
    """Files of earlier versions have no such key."""
    text = model_with().to_text()
    for written in (text, re.sub(r"effects:.*\n", "", text)):
        assert read_text(tmp_path, written).effects == EffectSet()


RIPPLE = model_with(effect("torque_ripple")).to_text()
SPIKE = model_with(effect("drag_spike")).to_text()
STRIBECK = model_with(effect("stribeck_shape", 0.6)).to_text()
ENTRY = re.compile(r"effects:\n(.|\n)*")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (RIPPLE.replace("effect: torque_ripple", "effect: torque_riple"), "did you mean 'torque_ripple'?"),
        (RIPPLE.replace("effect: torque_ripple", "effect: [torque_ripple]"), "effects.0.effect must be one of"),
        (RIPPLE.replace("- effect: torque_ripple", "- colour: red\n  effect: torque_ripple"), "colour"),
        (ENTRY.sub("effects: [3]\n", RIPPLE), "effects.0 must be a table of keys, found 3"),
        (ENTRY.sub("effects: {torque_ripple: 1}\n", RIPPLE), "list"),
        (ENTRY.sub("effects: torque_ripple\n", RIPPLE), "list"),
        (ENTRY.sub("effects: 0\n", RIPPLE), "list"),
        (RIPPLE.replace("value: 0.03, std", "value: much, std"), "value must be a number, found the text 'much'"),
        (RIPPLE.replace("value: 0.03, std", "value: 1.0e+9, std"), "allows"),
        (RIPPLE.replace("std: 0.001, unit: rad/s^2}\n  con", "unit: rad/s^2}\n  con"), "std is required"),
        (RIPPLE.replace("std: 0.001, unit", "std: -0.001, unit"), "std"),
        (RIPPLE.replace("std: 0.001, unit: rad/s^2", "std: 0.001, unit: N m"), "unit"),
        (RIPPLE.replace("order: 6.0, ", ""), "order is missing"),
        (RIPPLE.replace("order: 6.0", "order: six"), "order must be a number, found the text 'six'"),
        (RIPPLE.replace("order: 6.0", "order: -6.0"), "allows"),
        (RIPPLE.replace("order: 6.0", "order: 6.0, ordre: 7.0"), "ordre"),
        (SPIKE.replace("decay_s: 60.0", "decay_s: 0.0"), "allows"),
        (STRIBECK.replace("law: 1.0", "law: 7.0"), "allows"),
        (STRIBECK.replace("law: 1.0", "law: 0.5"), "law"),
        (RIPPLE.replace("covariance:\n", "covariance:\n- [1.0, 0.0, 0.0, 0.0, 0.0]\n"), "5 rows of 5"),
        (model_with(effect("friction_lag"), effect("presliding_hysteresis")).to_text(), "presliding_hysteresis"),
        (model_with(effect("transport_delay"), effect("transport_delay")).to_text(), "transport_delay"),
        (model_with(effect("stribeck_shape"), effect("stribeck_shape", 0.5)).to_text(), "stribeck_shape"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(tmp_path: Path, text: str, words: str) -> None:
    """Every wrong entry is a ConfigError with file:line:column, on a line of the file, that says what is wrong."""
    assert text != RIPPLE
    with pytest.raises(ConfigError) as caught:
        read_text(tmp_path, text)
    finding = next(line for line in str(caught.value).splitlines() if words in line)
    place = re.match(rf"{re.escape(str(tmp_path / 'model.yaml'))}:(\d+):(\d+): ", finding)
    assert place is not None, finding
    assert 1 < int(place[1]) <= text.count("\n")


def test_a_belief_has_its_hidden_states_last() -> None:
    """Coefficients with their covariance behind the parameters; hidden states are left to the first reading."""
    model = model_with(effect("actuator_lag", 0.05), effect("offset_torque", 0.02))
    belief = belief_of_model(model)
    assert belief.mean.tolist() == [0.0, *CK13_STATISTICAL, 0.05, 0.02, 0.0]
    assert np.array_equal(belief.covariance[1:7, 1:7], np.array(model.covariance))
    assert np.all(belief.covariance[7] == 0.0)


def test_what_belongs_to_a_record_is_not_carried_over(tmp_path: Path) -> None:
    """A spike and a drift are left behind, with their rows of the covariance, and told; dry friction is then open."""
    model = model_with(effect("drag_spike"), effect("offset_torque", 0.02), effect("coulomb_drift"))
    kept, notes = carried_over(model)
    assert kept.effects.ids == ("offset_torque",)
    places = [0, 1, 2, 3, 5]
    more = np.array(kept.covariance) - np.array(model.covariance)[np.ix_(places, places)]
    drifted = np.zeros((5, 5))
    drifted[2:4, 2:4] = (0.2 * model.parameters.coulomb) ** 2
    assert np.allclose(more, drifted, rtol=1e-9, atol=1e-15)
    assert len(notes) == 2
    assert "drag_spike" in notes[0]
    assert "coulomb_drift" in notes[1]
    assert read_text(tmp_path, kept.to_text()) == kept


def test_a_phase_is_not_carried_over(tmp_path: Path) -> None:
    """Amplitude is known, phase is not: sine and cosine begin at zero, each as uncertain as the amplitude is large."""
    grid = effect("speed_quantisation")
    model = model_with(effect("offset_torque", 0.02), pair("external_torque", 0.03, -0.04), grid)
    kept, notes = carried_over(model)
    assert notes == []
    assert kept.effects.ids == model.effects.ids
    assert kept.effects.values.tolist() == [0.02, 0.0, 0.0]
    covariance = np.array(kept.covariance)
    assert np.allclose(covariance[5:, 5:], 0.05**2 * np.eye(2), rtol=1e-12)
    assert np.all(covariance[:5, 5:] == 0.0)
    assert np.array_equal(covariance[:5, :5], np.array(model.covariance)[:5, :5])
    assert kept.effects.terms[1].stds == pytest.approx((0.05, 0.05))
    assert read_text(tmp_path, kept.to_text()) == kept


def test_a_run_that_learnt_nothing_leaves_the_amplitude_open(tmp_path: Path) -> None:
    """Carried over twice with nothing read in between, a periodic torque can still be learnt."""
    once, _ = carried_over(model_with(pair("torque_ripple", 0.03, -0.04)))
    twice, _ = carried_over(once)
    assert np.all(np.diag(np.array(twice.covariance))[4:] > 1.0e-4)
    assert read_text(tmp_path, twice.to_text()) == twice


def test_nothing_to_leave_behind_leaves_all() -> None:
    """A model without such effects is carried over as it is."""
    model = model_with(effect("quadratic_drag", 1.0e-6), effect("actuator_lag"))
    assert carried_over(model) == (model, [])


def test_an_inertia_that_nobody_gave_is_called_so_throughout(tmp_path: Path) -> None:
    """A default stays one through a model's file, and through the resolved configuration that a run leaves."""
    plain = Configuration.model_validate(
        {"wheel": {"port": "/dev/null"}, "output": {"directory": "."}, "limits": {"current_A": 0.1}}
    )
    resolved = Configuration.model_validate(plain.model_dump(mode="json"))
    setup = setup_of_configuration(plain, None)
    path = tmp_path / "model.yaml"
    path.write_text(model_of(setup.prior, setup, {}).to_text(), encoding="utf-8")
    assert setup_of_configuration(plain, read_model(path)).inertia_from == "assumed"
    assert setup_of_start(resolved, read_model(path)).inertia_from == "assumed"
    given = replace(read_model(path), inertia_kg_m2=2.0e-3, inertia_is_assumed=False)
    again = setup_of_configuration(plain, given)
    assert (again.inertia_kg_m2, again.inertia_from) == (2.0e-3, "model")


def considered_model() -> WheelModel:
    """A bump, a spike and a law of the speed, with two directions in which shapes and the law may be off."""
    law = Law("speed_size", "drag", 0.0, 100.0, ((0.0, 0.01, 0.02),))
    learned = Term(CATALOGUE["learned_law"], (1.0,), (0.1,), law=law)
    model = model_with(effect("drag_bump"), effect("drag_spike"), learned)
    curve = tuple(1.0e-4 * i for i in range(CURVE_POINTS))
    ways = (
        Direction((1.0e-3, 0.0, 2.0e-3, 0.0, 1.0e-3, 0.0, 0.01), (Off((0.2, -0.1, 0.0)), Off(), Off(curve=curve))),
        Direction((0.0, 1.0e-6, 0.0, 0.0, 0.0, 2.0e-3, 0.0), (Off(), Off((3.0, 0.0, 0.0)), Off())),
    )
    return replace(model, effects=replace(model.effects, considered=ways))


def test_what_no_filter_learns_comes_back(tmp_path: Path) -> None:
    """Shapes, curves and what the numbers do then, from file to model and on with other numbers."""
    model = considered_model()
    assert read_text(tmp_path, model.to_text()) == model
    again = model.effects.with_values(2.0 * model.effects.values, np.ones(3))
    assert again.considered == model.effects.considered


def test_it_goes_with_the_effects_it_is_of() -> None:
    """A spike stays behind when a run begins: its place and its numbers are gone from every direction."""
    kept, _ = carried_over(considered_model())
    assert kept.effects.ids == ("drag_bump", "learned_law")
    first, second = kept.effects.considered
    assert first.numbers == (1.0e-3, 0.0, 2.0e-3, 0.0, 1.0e-3, 0.01)
    assert second == Direction((0.0, 1.0e-6, 0.0, 0.0, 0.0, 0.0), (Off(), Off()))


def test_a_model_that_grows_keeps_what_was_considered() -> None:
    """Found with a model given and another effect beside it: what the first record left open is open still."""
    given = considered_model().effects
    grown = EffectSet((*given.terms, effect("quadratic_drag", 1.0e-6))).going_on_from(given)
    assert [way.numbers for way in grown.considered] == [(*way.numbers, 0.0) for way in given.considered]
    assert [way.terms for way in grown.considered] == [(*way.terms, Off()) for way in given.considered]
    moved = replace(given.terms[0], shape=(61.0, 7.5, 0.0))
    assert EffectSet((moved, *given.terms[1:])).going_on_from(given).considered == ()


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("numbers",), [0.0, 1.0], "are 2; these effects want 7"),
        (("terms",), [{}], "are 1; these effects want 3"),
        (("terms", 0, "constants"), {"sped_rad_s": 1.0}, "is not a constant of drag_bump; did you mean 'speed_rad_s'?"),
        (("terms", 0, "curve"), [0.0] * CURVE_POINTS, "has 17 numbers; drag_bump has no law"),
        (("terms", 2, "curve"), [0.0, 1.0], "has 2 numbers; a law's has 17"),
        (("numbers", 3), "much", "must be a number, found the text"),
    ],
)
def test_what_does_not_go_with_the_effects_is_refused(
    tmp_path: Path, path: tuple[str | int, ...], value: object, words: str
) -> None:
    """With its place in the file, one sentence."""
    document = considered_model().document()
    *way, last = path
    item = document["considered"][1]
    for key in way:
        item = item[key]
    item[last] = value
    with pytest.raises(ConfigError) as refused:
        read_text(tmp_path, yaml_text(document))
    assert "considered.1." + ".".join(map(str, path)) in str(refused.value).replace("[", ".").replace("]", "")
    assert words in str(refused.value)
