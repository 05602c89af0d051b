"""Effects by formulas: as those of the catalogue in every filter, in the plant, in model files, in the catalogue."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from rw_ekf.checking.effect_file import OwnFormula, own_formula
from rw_ekf.checking.yaml_loader import parse_yaml
from rw_ekf.course.course import Course
from rw_ekf.drivers.sim.plant_batch import compiled_advance, run_by, simulate_run
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_formula import split_formulas, with_formulas
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.effects.catalogue import CATALOGUE, with_own
from rw_ekf.effects.own_effect import OwnEffect, effect_of
from rw_ekf.errors import BadInputError, ConfigError
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.model.effect import NO_SHAPE, Effect, Term
from rw_ekf.model.moment import Moment
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.wheel.effect_table import EffectSet
from rw_ekf.wheel.model_file import WheelModel, model_from_data
from tests.filter.effect_replay import WHEEL, believed, both, rough_log
from tools.measure.runs import constants_for


def formula(kind: str, text: str, **constants: tuple[float, float, float]) -> OwnFormula:
    """One with the coefficient `a`, and constants by start and range."""
    more = {name: {"unit": "1", "start": start, "range": [low, high]} for name, (start, low, high) in constants.items()}
    return own_formula("mine", {kind: text, "a": {"unit": "1"}, **more})


def own(kind: str, text: str, **constants: tuple[float, float, float]) -> type[OwnEffect]:
    """The effect of such a formula."""
    return effect_of(formula(kind, text, **constants))


B = CK13_STATISTICAL.viscous
EDDY = own("drag", "a * omega / (1 + (omega / w0)**2)", w0=(50.0, 1.0, 500.0))


@pytest.mark.parametrize(
    ("kind", "text", "like", "shape", "value"),
    [
        ("torque", "a*omega**3", "cubic_drag", (0.0, 0.0, 0.0), 1.0e-6),
        ("torque", "a*omega*abs(omega)", "quadratic_drag", (0.0, 0.0, 0.0), 1.0e-4),
        ("torque", "a", "offset_torque", (0.0, 0.0, 0.0), 0.05),
        ("motor_gain", "-a*abs(current)", "motor_saturation", (0.0, 0.0, 0.0), 0.3),
    ],
)
def test_a_formula_is_its_twin_of_the_catalogue(
    kind: str, text: str, like: str, shape: tuple[float, float, float], value: float
) -> None:
    """The compiled filter believes the same of a rough log, to rounding, whichever of the two it has."""
    log, temperature, angle = rough_log(3)
    runs = []
    twins: list[type[Effect]] = [own(kind, text), CATALOGUE[like]]
    for effect in twins:
        effects = EffectSet((Term.of(effect, shape, value, value),))
        belief = believed(effects)
        course = Course.of(log.time_s, log.speed_rad_s, log.current_A, log.delay_s, log.segment, temperature, angle)
        runs.append(filter_log(course, constants_for(), belief.mean, belief.covariance, effects, keep_states=True))
    assert runs[0].states == pytest.approx(runs[1].states, rel=1e-9, abs=1e-12)
    assert runs[0].stds == pytest.approx(runs[1].stds, rel=1e-8, abs=1e-12)


@pytest.mark.parametrize(
    "effect",
    [
        EDDY,
        own("viscous", "a*exp(-(temperature - 20)/w)", w=(10.0, 1.0, 50.0)),
        own("torque", "a*sin(3*angle + 0.2*time) + a*log(omega)"),
    ],
)
def test_the_daemon_s_filter_is_the_compiled_one(effect: type[OwnEffect]) -> None:
    """Sample by sample the same belief, finite throughout, where the formula has no value too."""
    shape = effect.candidates(WHEEL)[0].shape
    effects = EffectSet((Term.of(effect, shape, 0.002, 0.01),))
    results, run = both(*rough_log(7), effects)
    online = np.array([result.values for result in results])
    assert np.isfinite(run.states).all()
    assert np.max(np.abs(online - run.states) / run.stds) < 1.0e-6


def test_a_drag_without_a_speed_in_it_is_dry_friction() -> None:
    """It holds a wheel at rest: break-away is later by it."""
    effect = own("drag", "a")
    assert effect.contribution(0.1, NO_SHAPE, Moment(5.0, 0.0, 20.0, 0.0, 0.0, 0.1)) == pytest.approx(
        (0, 0, 0, 0, 0, 0.1)
    )
    assert effect.contribution(0.1, NO_SHAPE, Moment(0.0, 0.0, 20.0, 0.0, 0.0, 0.1)) == pytest.approx(
        (0, 0, 0, 0, 0, 0.1)
    )


@pytest.mark.parametrize(
    ("own_text", "kind", "text", "like"),
    [
        ("mine:a=1e-6", "drag", "a*omega**3", "cubic_drag:coefficient_s_rad2=1e-6"),
        ("mine:a=0.05", "torque", "a", "offset_torque:torque_rad_s2=0.05"),
        ("mine:a=0.2", "motor_gain", "-a*abs(current)", "motor_saturation:slope_1_A=0.2"),
        ("mine:a=-6e-5", "viscous", "a*(temperature - 20)", f"viscous_temperature:slope_1_K={-6e-5 / B}"),
    ],
)  # fmt: skip
def test_the_plant_s_formula_is_its_own_twin(own_text: str, kind: str, text: str, like: str) -> None:
    """A wheel driven through zero and back: the tree walked in small steps, and the plant's own compiled effect."""
    time_s = 0.1 * np.arange(300)
    current = 0.12 * np.sin(2.0 * np.pi * time_s / 15.0)
    rest, found = split_formulas([own_text], [formula(kind, text)])
    assert rest == []
    still = PlantNoise(0.0, 0.0)
    run = run_by(with_formulas(compiled_advance, found))
    mine = simulate_run(PlantParameters(), current, time_s, still, run=run)
    plant = simulate_run(parse_effects([like]), current, time_s, still)
    healthy = simulate_run(PlantParameters(), current, time_s, still)
    made = np.max(np.abs(plant.speed_rad_s - healthy.speed_rad_s))
    assert np.max(np.abs(mine.speed_rad_s - plant.speed_rad_s)) < 0.02 * made


@pytest.mark.parametrize("text", ["mine", "mine:a=x", "mine:a=nan", "mine:b=1", "mine:a=1,a=2", "mine:w=1"])
def test_a_wheel_s_formula_needs_its_numbers(text: str) -> None:
    """One sentence that says which."""
    with pytest.raises(BadInputError, match="mine"):
        split_formulas([text], [formula("drag", "a*w", w=(1.0, 0.5, 2.0))])


def test_sizes_are_torques_over_the_record() -> None:
    """Smallest and largest bracket what a wheel may have; a formula without a value is not tested, and says where."""
    assert 0.0 < EDDY.smallest(WHEEL) < EDDY.largest(WHEEL)
    term = Term.of(EDDY, (50.0, 0.0, 0.0), 0.01, 0.001)
    assert EDDY.torque(term.shape, WHEEL) == pytest.approx(25.0, rel=0.05)  # a w0/2 at w0
    assert EDDY.matters([term], WHEEL)
    assert EDDY.possible([term], WHEEL, CK13_STATISTICAL.coulomb)
    assert EDDY.untestable(WHEEL) is None
    none = own("torque", "a*log(omega)")
    assert "no value at omega = -" in str(none.untestable(WHEEL))
    assert not none.possible([Term.of(none, value=1.0)], WHEEL, 0.5)
    assert "temperature" in str(
        own("drag", "a*temperature").untestable(dataclasses.replace(WHEEL, channels=frozenset()))
    )
    assert len(EDDY.candidates(WHEEL)) == 13
    assert EDDY.sentence(0.01, 0.001, (500.0, 0.0, 0.0), WHEEL).startswith("Your mine is there, drag = a * omega")


def test_the_catalogue_has_a_user_s_own_for_as_long_as_they_are_used() -> None:
    """And refuses two of one id; one formula is one class."""
    assert EDDY is own("drag", "a * omega / (1 + (omega / w0)**2)", w0=(50.0, 1.0, 500.0))
    with with_own([EDDY]):
        assert CATALOGUE["mine"] is EDDY
        assert list(CATALOGUE)[-1] == "mine"
        with pytest.raises(ConfigError, match="two formulas"), with_own([own("drag", "a*omega")]):
            pass
    assert "mine" not in CATALOGUE


def model() -> WheelModel:
    """One with the effect."""
    variances = np.diag([1e-4, 1e-10, 1e-6, 1e-5, 1e-8])
    covariance = tuple(tuple(map(float, row)) for row in variances)
    effects = EffectSet((Term.of(EDDY, (31.0, 0.0, 0.0), 0.004, 1e-4),))
    return WheelModel(CK13_STATISTICAL, covariance, 0.42, effects=effects)


def test_a_model_file_holds_the_formula() -> None:
    """Read again without the file that it came from: text, numbers, covariance, and the very same effect."""
    written = model().to_text()
    document = parse_yaml(written, "model.yaml")
    read = model_from_data(document.data, document.where)
    assert read.effects == model().effects
    assert read.own_effects == (EDDY,)
    assert read.to_text() == written


@pytest.mark.parametrize(
    ("change", "stated"),
    [
        ({"formula": {"drag": "a*omegaa", "a": {"unit": "1"}}}, "unknown name 'omegaa'"),
        ({"formula": {"drag": "a*omega", "a": {"unit": "1"}}}, "w0"),
        ({"formula": None}, "must be one of"),
        ({"formula": 3}, "formula"),
        ({"effect": "quadratic_drag"}, "of the catalogue"),
        ({"effect": "x y"}, "no id"),
        ({"constants": {"w0": 1000.0}}, "allows 1 to 500"),
        ({"constants": {}}, "is missing"),
    ],
)
def test_a_model_file_with_a_wrong_formula_is_refused(change: dict[str, Any], stated: str) -> None:
    """With the place of what is wrong."""
    data = model().document()
    data["effects"][0] |= change
    with pytest.raises(ConfigError) as caught:
        model_from_data(data, lambda path: "model.yaml:1:1:" + ".".join(map(str, path)))
    assert stated in str(caught.value)
    assert str(caught.value).startswith("model.yaml:1:1:effects.0")


def test_two_formulas_of_one_id_are_refused_in_a_model() -> None:
    """A diagnosis could not tell them apart."""
    data = model().document()
    other = {**data["effects"][0], "formula": {"drag": "a*omega", "a": {"unit": "1"}}, "constants": {}}
    data["effects"].append(other)
    with pytest.raises(ConfigError, match="another than that of mine"):
        model_from_data(data, lambda path: ".".join(map(str, path)))
