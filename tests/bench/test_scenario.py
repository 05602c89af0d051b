"""A scenario says what it is, and what is wrong with it."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

from rw_ekf.attitude_bench.bench_wheels import drawn_wheel
from rw_ekf.attitude_bench.prepare import REPRESENTATIVE, scenario_of, schemes_of, with_wheel_of
from rw_ekf.attitude_bench.scenario import Scenario, load_scenario
from rw_ekf.control.compensation.schemes import SCHEMES
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.errors import BadInputError, ConfigError
from rw_ekf.model.effect import Effect, Term
from rw_ekf.model.effect_kinds import LawEffect
from rw_ekf.model.law import Law
from rw_ekf.wheel.effect_table import EffectSet
from rw_ekf.wheel.model_file import read_model

MODEL = """\
schema: rw_ekf.model/1
stribeck: {speed_rad_s: 0.42, law: gauss}
inertia_kg_m2: 0.002
parameters:
  motor_gain: {value: 14.0, std: 0.01, unit: rad/s^2/A}
  viscous: {value: 0.004, std: 0.0001, unit: 1/s}
  coulomb: {value: 0.6, std: 0.001, unit: rad/s^2}
  static: {value: 0.65, std: 0.01, unit: rad/s^2}
covariance:
  - [1.0e-4, 0, 0, 0, 0]
  - [0, 1.0e-8, 0, 0, 0]
  - [0, 0, 1.0e-6, 0, 0]
  - [0, 0, 0, 1.0e-4, 0]
  - [0, 0, 0, 0, 1.0e-6]
noise: {speed_rad_s: 0.1, acceleration_rad_s_per_sqrt_s: null}
effects:
  - effect: offset_torque
    coefficient: {name: torque_rad_s2, value: -0.05, std: 0.001, unit: rad/s^2}
    constants: {}
"""


def test_the_default_is_the_experiment_of_ck13() -> None:
    """The fan takes the wheel's 674 rpm away in 230 s, and the derivative gain is critical."""
    scenario = Scenario()
    assert scenario.reversal_s == pytest.approx(230.0, abs=0.3)
    assert scenario.derivative_Nms_rad == pytest.approx(0.382, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "stated"),
    [
        ("body: {inertia_kg_m2: -1}", ":1:23: body.inertia_kg_m2 must be above 0"),
        ("wheel: {start_rpm: 600}\nbody: {fan: 1}", ":2:8: unknown key body.fan"),
        ("wheels: {}", ":1:1: unknown key wheels"),
        ("cycle: {speed_noise_rpm: []}", "cycle.speed_noise_rpm"),
        ("wheel: {effects: [offset torque]}", "wheel.effects.0"),
        ("- 1", "a scenario must be a table of body, control"),
    ],
)
def test_a_mistake_in_a_scenario_is_named_with_its_place(tmp_path: Path, text: str, stated: str) -> None:
    """file:line:column, the key, and what is allowed."""
    path = tmp_path / "scenario.yaml"
    path.write_text(text + "\n", encoding="utf-8")
    with pytest.raises(ConfigError) as raised:
        load_scenario(path)
    assert any(stated in finding and finding.startswith(str(path)) for finding in raised.value.findings)


def test_a_wheel_that_cannot_reverse_is_refused(tmp_path: Path) -> None:
    """A disturbance that speeds the wheel up, and a run too short for the reversal."""
    path = tmp_path / "scenario.yaml"
    path.write_text("body: {disturbance_Nm: 0.46e-3}\n", encoding="utf-8")
    with pytest.raises(BadInputError, match="never reverses"):
        scenario_of(str(path), None, [])
    path.write_text("cycle: {duration_s: 100}\n", encoding="utf-8")
    with pytest.raises(BadInputError, match="would reverse after 230 s"):
        scenario_of(str(path), None, [])


def test_a_run_that_ends_before_the_reversal_is_judged_whole_is_refused(tmp_path: Path) -> None:
    """The sentence says how long it must be, and so long it is taken, as is the default written out."""
    path = tmp_path / "scenario.yaml"
    for duration_s in (231, 340):
        path.write_text(f"cycle: {{duration_s: {duration_s}}}\n", encoding="utf-8")
        with pytest.raises(
            BadInputError, match=rf"120 s from there on, but cycle.duration_s is {duration_s} s: .* 351 s"
        ):
            scenario_of(str(path), None, [])
    for duration_s in (350, 351):
        path.write_text(f"cycle: {{duration_s: {duration_s}}}\n", encoding="utf-8")
        assert scenario_of(str(path), None, []).cycle.duration_s == duration_s


def test_a_run_that_nobody_gave_a_length_lasts_until_a_later_reversal_is_judged(tmp_path: Path) -> None:
    """A model's heavier wheel reverses after 307 s; a start that would take hours is refused all the same."""
    model, path = tmp_path / "model.yaml", tmp_path / "scenario.yaml"
    model.write_text(MODEL, encoding="utf-8")
    assert scenario_of(None, read_model(model), []).cycle.duration_s == 427.0
    assert scenario_of(None, None, []).cycle.duration_s == 350.0
    path.write_text("cycle: {duration_s: 350}\n", encoding="utf-8")
    with pytest.raises(BadInputError, match="a scenario 427 s or more of it"):
        scenario_of(str(path), read_model(model), [])
    path.write_text("body: {disturbance_Nm: -0.46e-5}\n", encoding="utf-8")
    with pytest.raises(BadInputError, match="would reverse after 23016 s"):
        scenario_of(str(path), None, [])


def test_an_unknown_scheme_and_an_unknown_effect_are_refused_with_what_there_is() -> None:
    """Both sentences list what exists."""
    with pytest.raises(BadInputError, match="there is no such scheme; there are pid_current"):
        schemes_of(["pid"])
    with pytest.raises(BadInputError, match="unknown effect 'offset'"):
        scenario_of(None, None, ["offset"])


def test_the_wheel_of_a_model_stands_on_the_bench_with_its_effects(tmp_path: Path) -> None:
    """Parameters, inertia and the offset of a model file are those of the simulated wheel."""
    path = tmp_path / "model.yaml"
    path.write_text(MODEL, encoding="utf-8")
    scenario = with_wheel_of(Scenario(), read_model(path))
    plant = drawn_wheel(scenario, 1)
    assert (plant.motor_gain, plant.viscous, plant.coulomb, plant.static) == (14.0, 0.004, 0.6, 0.65)
    assert plant.offset_rad_s2 == pytest.approx(-0.05)
    assert plant.stribeck_speed_rad_s == pytest.approx(0.42)
    assert scenario.wheel.inertia_kg_m2 == 0.002


def test_a_spike_of_a_model_sets_in_before_the_reversal_of_its_own_wheel(tmp_path: Path) -> None:
    """Twenty seconds before 307 s, when the heavier wheel reverses, and not before 231 s, when the scenario's would."""
    path = tmp_path / "model.yaml"
    path.write_text(MODEL, encoding="utf-8")
    spike = Term.of(CATALOGUE["drag_spike"], (100.0, 60.0, 0.0), 0.05)
    scenario = with_wheel_of(Scenario(), replace(read_model(path), effects=EffectSet((spike,))))
    assert scenario.reversal_s is not None
    (text,) = scenario.wheel.effects
    (onset_s,) = re.findall(r"onset_s=([\d.]+)", text)
    assert float(onset_s) == pytest.approx(scenario.control.settling_s + scenario.reversal_s - 20.0)


@pytest.mark.parametrize("effect", [effect for effect in CATALOGUE.values() if not issubclass(effect, LawEffect)])
def test_each_effect_that_a_diagnosis_can_name_stands_on_the_bench(tmp_path: Path, effect: type[Effect]) -> None:
    """With all its coefficients and constants, by the laws that it may follow, in a wheel of any Stribeck law."""
    plain = (tmp_path / "model.yaml", MODEL.replace("law: gauss", "law: tustin").partition("effects:")[0])
    plain[0].write_text(plain[1].replace(", 0]", "]").replace("  - [0, 0, 0, 0, 1.0e-6]\n", ""), encoding="utf-8")
    model = read_model(plain[0])
    values = tuple(0.04 + 0.03 * number for number in range(effect.components))
    laws = (0.0, 1.0) if effect.constants and effect.constants[0].name == "law" else (1.0,)
    for law in laws:
        term = Term(effect, values, (0.01,) * len(values), (law, 0.5, 7.0))
        scenario = scenario_of(None, replace(model, effects=EffectSet((term,))), [])
        plant = drawn_wheel(scenario, 1)
        assert plant != drawn_wheel(scenario.changed("wheel", effects=()), 1)
        code = {
            "viscous_temperature": plant.viscous_temperature_law,
            "coulomb_temperature": plant.coulomb_temperature_law,
        }
        assert code.get(effect.id, law) == law
        if effect.id == "external_torque":
            assert plant.external_rad_s2 == pytest.approx(math.hypot(*values))
            assert plant.external_phase_rad == pytest.approx(0.5 + math.atan2(values[1], values[0]))


def test_a_model_that_no_simulated_wheel_is_like_is_refused_with_a_reason(tmp_path: Path) -> None:
    """A law without a formula, and two torques with a clock, of which a simulated wheel has one."""
    path = tmp_path / "model.yaml"
    path.write_text(MODEL, encoding="utf-8")
    law = Law("speed", "drag", 0.0, 10.0, ((0.0, 0.1),))
    learned = Term(CATALOGUE["learned_law"], (1.0,), (0.1,), law=law)
    twice = (Term(CATALOGUE["external_torque"], (0.1,), (0.01,), (frequency, 0.0, 0.0)) for frequency in (0.1, 0.2))
    for terms, words in (((learned,), "learned_law has none"), (tuple(twice), "external_torque is given twice")):
        with pytest.raises(BadInputError, match=f"the bench has no wheel like this model's: .*{words}"):
            with_wheel_of(Scenario(), replace(read_model(path), effects=EffectSet(terms)))


def test_a_drawn_wheel_stays_within_the_spread_and_never_breaks_away_below_its_coulomb_friction() -> None:
    """Thirty seeds at 15 %: another wheel each, the same again for the same seed."""
    wheel = Scenario().wheel.model_copy(update={"spread_percent": 15.0})
    scenario = Scenario().model_copy(update={"wheel": wheel})
    plants = [drawn_wheel(scenario, seed) for seed in range(30)]
    assert len({plant.motor_gain for plant in plants}) == 30
    assert all(0.85 <= plant.coulomb / 0.5863 <= 1.15 and plant.static >= plant.coulomb for plant in plants)
    assert drawn_wheel(scenario, 3) == plants[3]


def test_without_a_word_there_is_one_scheme_of_each_kind() -> None:
    """The default is the documented list; "all" is the registry, and no name in any company."""
    assert schemes_of(None) == list(REPRESENTATIVE)
    text = (Path(__file__).parents[2] / "docs" / "bench.md").read_text(encoding="utf-8")
    (reported,) = re.findall(r"Without `--schemes` it runs (.*?): the recommended", text, re.DOTALL)
    assert tuple(re.findall(r"`(\w+)`", reported)) == REPRESENTATIVE
    assert schemes_of(["all"]) == list(SCHEMES)
    with pytest.raises(BadInputError, match="there is no such scheme"):
        schemes_of(["all", "dmc"])
