"""Laws that have no formula, found on wheels of another integrator, and worth something on the next log."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.log_replay import replay_log
from rw_ekf.model.effect import Term
from rw_ekf.model.law import Law
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.wheel.effect_table import EffectSet
from rw_ekf.wheel.model_file import WheelModel, model_from_data
from tools.measure.laws import judged
from tools.proof.uncatalogued_laws import C, Nameless

pytestmark = pytest.mark.slow


def parameters_of(diagnosis: Diagnosis, name: str) -> dict[str, Any]:
    """What the document tells of an effect."""
    found: dict[str, Any] = next(
        item["parameters"] for item in diagnosis.document()["candidates"] if item["effect"] == name
    )
    return found


@functools.cache
def found_in(name: str) -> Diagnosis:
    """The diagnosis of the first log of such a wheel, made once for the tests of it."""
    return diagnose_log(Nameless(name, 11).log())


@pytest.mark.parametrize(
    ("name", "quantity", "kind"),
    [
        pytest.param(
            "gain by bus voltage", "bus_voltage_V", "motor_gain", marks=pytest.mark.xdist_group("gain by bus voltage")
        ),
        pytest.param(
            "pressure, viscous", "pressure_Pa", "viscous_drag", marks=pytest.mark.xdist_group("pressure, viscous")
        ),
        ("current, square", "current_along_motion", "drag"),
        ("speed, wave", "speed_size", "drag"),
    ],
)
def test_a_law_without_a_formula_is_found_and_predicts_the_next_log(name: str, quantity: str, kind: str) -> None:
    """Told by quantity and kind; its band holds the truth, and the next log is missed by hardly more than noise."""
    diagnosis = found_in(name)
    assert diagnosis.verdict["effects"] == ["learned_law"], diagnosis.verdict["statement"]
    assert diagnosis.verdict["posterior"]["learned_law"] > 0.9
    found = parameters_of(diagnosis, "learned_law")
    assert (found["quantity"]["value"], found["kind"]["value"]) == (quantity, kind)
    assert len(found["knots"]["value"]) == len(found["values"]["value"]) == len(found["std"]["value"])
    reported = judged(Nameless(name, 11), diagnosis)
    assert reported.after.readings_rpm < 1.2 * reported.noise_rpm < 0.9 * reported.before.readings_rpm
    assert reported.covered is not None
    assert reported.covered > 0.8


def test_a_bridge_of_two_halves_is_a_torque_by_the_size_of_the_current() -> None:
    """Its level has nothing else to follow it; without it the next log was missed by 169 rpm, the base model by 14."""
    case = Nameless("current, halves", 12)
    diagnosis = diagnose_log(case.log())
    assert diagnosis.verdict["effects"] == ["learned_law"], diagnosis.verdict["statement"]
    reported = judged(case, diagnosis)
    assert reported.what == "torque over current_size"
    assert reported.after.readings_rpm < 1.2 * reported.noise_rpm < 0.2 * reported.before.readings_rpm


def test_something_that_begins_is_told_with_its_time_and_holds_in_the_next_log() -> None:
    """A motor gain lower by 5 % from 280 s on; in a log that is lower throughout the model holds from its begin."""
    case = Nameless("gain begins", 11)
    diagnosis = diagnose_log(case.log())
    assert diagnosis.verdict["effects"] == ["change"], diagnosis.verdict["statement"]
    found = parameters_of(diagnosis, "change")
    assert found["what"]["value"] == "motor_gain"
    assert found["begins_at"]["value"] == pytest.approx(280.0, abs=1.0)
    assert found["size"]["value"] == pytest.approx(-0.05, abs=0.001)
    assert diagnosis.model is not None
    weak = replace(Nameless("gain for good", 1011).log(), name="next.csv")
    log = replay_log(weak, model=diagnosis.model).document()["logs"][0]
    value, std = (log[key]["motor_gain"] for key in ("state", "std"))
    assert value == pytest.approx(15.205, abs=5.0 * std)


@pytest.mark.parametrize(
    ("name", "kind", "size"),
    [
        ("drag, a while", "drag", -0.08 * C),
        ("gain, a while", "motor_gain", -0.08),
        ("torque, a while", "torque", 0.08 * C),
    ],
)
def test_something_that_lasts_a_while_is_told_with_both_its_times(name: str, kind: str, size: float) -> None:
    """From 126 to 168 s of 420; the next log, in which it lasts no longer, is foretold by a wheel without it."""
    diagnosis = diagnose_log(Nameless(name, 11).log())
    assert diagnosis.verdict["effects"] == ["spell"], diagnosis.verdict["statement"]
    found = parameters_of(diagnosis, "spell")
    assert found["what"]["value"] == kind
    for key, time_s in (("begins_at", 126.0), ("ends_at", 168.0)):
        assert abs(found[key]["value"] - time_s) < max(4.0 * found[key]["std"], 1.0)
    assert abs(found["size"]["value"] - size) < max(4.0 * found["size"]["std"], 0.02 * abs(size))
    assert diagnosis.model is not None
    after = replace(Nameless("", 1011).log(), name="next.csv")
    entry = replay_log(after, model=model_from_data(diagnosis.model.document(), lambda path: "model.yaml")).document()
    assert entry["logs"][0]["innovation"]["nis_mean"] == pytest.approx(1.0, abs=0.05)


def test_a_model_with_a_law_is_adequate_for_its_wheel() -> None:
    """Written, read again, given to the next log: nothing is left, and the amplitude is one within its sigmas."""
    diagnosis = diagnose_log(Nameless("voltage, drag", 11).log())
    assert diagnosis.model is not None
    model: WheelModel = model_from_data(diagnosis.model.document(), lambda path: "model.yaml")
    following = Nameless("voltage, drag", 1011).log()
    assert diagnose_log(following, model=model).verdict["kind"] == "adequate"
    amplitude = replay_log(following, model=model).document()["logs"][0]["effects"]["learned_law"]
    assert abs(amplitude["value"] - 1.0) < 4.0 * amplitude["std"]


class TwoLaws(Nameless):
    """A wheel whose motor gain follows the bus voltage beside the law of its name."""

    @property
    def law(self) -> Any:
        """Both laws."""
        one, other = super().law, Nameless("gain by bus voltage", self.seed).law
        return lambda met: one(met)._replace(gain=one(met).gain + other(met).gain)


@pytest.mark.xdist_group("pressure, viscous")
def test_a_second_law_is_told_beside_one_that_the_model_given_has() -> None:
    """It counted as nothing new: "adequate, nothing was added" beside a free run of several rpm, and no model."""
    given = found_in("pressure, viscous").model
    diagnosis = diagnose_log(TwoLaws("pressure, viscous", 11).log(), model=given)
    assert diagnosis.verdict["effects"] == ["learned_law"], diagnosis.verdict["statement"]
    assert parameters_of(diagnosis, "learned_law")["quantity"]["value"] == "bus_voltage_V"
    document = diagnosis.document()
    assert document["after"]["free_run_rms_rpm"] < min(1.3, 0.5 * document["before"]["free_run_rms_rpm"])
    assert diagnosis.model is not None
    laws = [term.law.column for term in diagnosis.model.effects.terms if term.law is not None]
    assert laws == ["pressure_Pa", "bus_voltage_V"]


@pytest.mark.xdist_group("gain by bus voltage")
def test_where_a_log_goes_beyond_a_law_that_is_said() -> None:
    """The next log has voltages that the first had not: a replay says so, a diagnosis finds it anew."""
    diagnosis = found_in("gain by bus voltage")
    following = Nameless("gain by bus voltage", 1011).log()
    warnings = replay_log(following, model=diagnosis.model).document()["logs"][0]["warnings"]
    assert any("bus_voltage_V is beyond what the learned law was found over" in text for text in warnings)
    again = diagnose_log(following, model=diagnosis.model)
    assert again.verdict["effects"] == ["learned_law"]
    document = again.document()
    assert document["after"]["free_run_rms_rpm"] < min(1.3, 0.2 * document["before"]["free_run_rms_rpm"])
    assert again.model is not None
    assert [term.law.column for term in again.model.effects.terms if term.law is not None] == ["bus_voltage_V"]
    assert any("and sought anew" in text for text in document["warnings"])


def test_a_gain_that_differs_by_direction_is_a_law_of_the_signed_speed() -> None:
    """Two percent less one way round: it jumps at rest, and neither a spell nor a drift is named; adequate with it."""
    diagnosis = diagnose_log(Nameless("speed, gain", 1005).log())
    assert diagnosis.verdict["effects"] == ["learned_law"]
    assert diagnosis.model is not None
    (term,) = diagnosis.model.effects.terms
    assert term.law is not None
    assert (term.law.quantity, term.law.acts_as) == ("speed", "motor_gain")
    values = term.law.values(term.values)
    half = values.size // 2
    assert np.mean(values[:half]) - np.mean(values[half:]) == pytest.approx(-0.02, abs=0.004)
    following = diagnose_log(Nameless("speed, gain", 1011).log(), model=diagnosis.model)
    assert following.verdict["kind"] == "adequate"


@pytest.mark.parametrize(("of", "size"), [("change", 5 + 2 + 1), ("learned_law", 5 + 1 + 1)])
def test_a_model_with_a_law_of_time_and_hidden_states_is_a_base_for_the_next_log(of: str, size: int) -> None:
    """What friction remembers stands behind the coefficients, where a change is held at an end and a curve left out."""
    change = Law("time", "torque", 280.0, 280.01, ((0.0, 1.0),), spread=(2.0,))
    bristle = Term.of(CATALOGUE["presliding_hysteresis"], (0.3, 0.0, 0.0), 0.05)
    terms = (Term(CATALOGUE[of], (0.05,), (0.01,), law=change), bristle)
    model = WheelModel(CK13_STATISTICAL, tuple(tuple(row) for row in 1e-6 * np.eye(6)), 0.42, effects=EffectSet(terms))
    prepared = prepare(source_of([Nameless("", 1011).log()]), None, model, "blocks")
    assert prepared.setup.prior.mean.size == prepared.setup.effects.table().size == size


@pytest.mark.parametrize("seed", [21, 22])
def test_a_healthy_wheel_is_given_no_law(seed: int) -> None:
    """Although voltage and pressure are logged, and go up and down."""
    diagnosis = diagnose_log(Nameless("healthy", seed).log())
    assert diagnosis.verdict["kind"] == "adequate", diagnosis.verdict["statement"]
    assert np.isnan(diagnosis.verdict["posterior"].get("learned_law", np.nan))


def test_friction_that_grows_with_speed_is_no_break_away_below_coulomb_friction() -> None:
    """Another Stribeck curve would do, were a wheel easier to start than to keep going: that is refused."""
    document = diagnose_log(Nameless("friction grows early", 1).log()).document()
    assert "stribeck_shape" not in document["verdict"]["effects"]
    wanted = [check for row in document["ledger"] for check in row["checks"] if "break-away" in check["check"]]
    assert all(check["value"] > 10.0 and not check["passed"] for check in wanted)
    assert wanted or document["verdict"]["effects"] == ["learned_law"]
