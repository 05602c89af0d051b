"""A model of one record in another: its shapes are the second record's, and a contradiction is said."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rw_ekf
from rw_ekf.cli import main
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_parameters import PlantParameters
from rw_ekf.effects.catalogue import CATALOGUE, LEARNED
from rw_ekf.learning.aged_model import carried_over
from rw_ekf.log_replay import replay_log
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.effect import Term
from rw_ekf.model.law import Law
from rw_ekf.model.state import PARAMETERS, FrictionParameters
from rw_ekf.second_record import _apart, _birge, parameters_by_now
from rw_ekf.wheel.effect_table import EffectSet
from rw_ekf.wheel.model_file import WheelModel
from tests.diagnosis.simulated import TRUTH, simulated
from tests.diagnosis.simulated import log_of as run_log
from tools.proof.cases import Case
from tools.proof.plants import log_of, save_log

WHEEL = PlantParameters()
PARAMETERS_OF_PLANT = ("motor_gain", "viscous", "coulomb", "static")
ONSET_S, DECAY_S, AMPLITUDE = 280.0, 60.0, 0.09


def record(seed: int) -> WheelLog:
    """Ten minutes of a wheel with a spike."""
    text = f"drag_spike:amplitude_rad_s2={AMPLITUDE},onset_s={ONSET_S},decay_s={DECAY_S}"
    assert parse_effects((text,), WHEEL)
    case = Case(
        "spike", "", "effects", ("drag_spike",), (text,), WHEEL, "identification", 7, seed, 1.0, telemetry=False
    )
    return log_of(case)


def model(onset_s: float, gain_off: float = 0.0) -> WheelModel:
    """What a diagnosis of another record left."""
    spike = Term(CATALOGUE["drag_spike"], (AMPLITUDE,), (0.005,), (onset_s, DECAY_S, 0.0))
    parameters = FrictionParameters(WHEEL.motor_gain + gain_off, WHEEL.viscous, WHEEL.coulomb, WHEEL.static)
    covariance = tuple(tuple(row) for row in np.diag(np.square([0.01, 2.0e-5, 1.0e-3, 5.0e-3, 0.005])).tolist())
    return WheelModel(parameters, covariance, WHEEL.stribeck_speed_rad_s, effects=EffectSet((spike,)))


def test_an_onset_of_another_record_is_not_taken_for_certain() -> None:
    """With an onset 2 s off the amplitude stays within three sigmas, and the record has its own onset, told."""
    for seed, off_s in ((1, 2.0), (2, -2.0)):
        found = replay_log(record(seed), model=model(ONSET_S + off_s))
        assert abs(found.belief.mean[5] - AMPLITUDE) < 3.0 * found.belief.std[5]
        assert any("onset_s 2" in warning for warning in found.warnings)
        assert abs(found.setup.effects.terms[0].shape[0] - ONSET_S) < 1.0


def test_a_fit_leaves_open_what_a_replay_does(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`fit --prior` of a record whose spike begins 2 s before the model's: its amplitude within three sigmas, told."""
    save_log(record(1), str(tmp_path / "b.csv"))
    (tmp_path / "m.yaml").write_text(model(ONSET_S + 2.0).to_text())
    assert main(["fit", str(tmp_path / "b.csv"), "--prior", str(tmp_path / "m.yaml"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    spike = found["effects"]["drag_spike"]
    assert abs(spike["value"] - AMPLITUDE) < 3.0 * spike["std"]
    assert any("onset_s 2" in warning for warning in found["warnings"])


def test_a_model_that_the_log_contradicts_is_said_to_and_counts_for_less() -> None:
    """A gain 20 of the model's sigmas off is told, and the log's own comes out; one that is right is not accused."""
    right, wrong = (replay_log(record(3), model=model(ONSET_S, off)) for off in (0.0, 0.2))
    assert not any("contradict" in warning for warning in right.warnings)
    assert any("contradict" in warning and "motor_gain" in warning for warning in wrong.warnings)
    assert abs(wrong.belief.parameters.motor_gain - WHEEL.motor_gain) < 0.02
    unknown = replace(model(ONSET_S), effects=EffectSet(()), covariance=tuple(r[:4] for r in model(0.0).covariance[:4]))
    assert replay_log(record(3), model=unknown).setup.effect_hypotheses == ()


CHANGES = {
    "coulomb +2 %": {"coulomb": 1.02}, "coulomb +8 %": {"coulomb": 1.08}, "coulomb -10 %": {"coulomb": 0.9},
    "coulomb +30 %": {"coulomb": 1.3}, "viscous +20 %": {"viscous": 1.2}, "viscous -50 %": {"viscous": 0.5},
    "gain +3 %": {"motor_gain": 1.03}, "all": {"motor_gain": 1.3, "viscous": 0.3, "coulomb": 0.7},
}  # fmt: skip


@pytest.mark.parametrize("change", CHANGES)
def test_a_wheel_that_has_changed_since_its_model_has_its_own_numbers(change: str) -> None:
    """By hundredths, what a temperature does, or wholly: a replay and a fit find them, and say what is another."""
    times = CHANGES[change]
    now = WHEEL._replace(**{name: times.get(name, 1.0) * getattr(WHEEL, name) for name in PARAMETERS_OF_PLANT})
    now = now._replace(static=now.coulomb + WHEEL.static - WHEEL.coulomb)
    before = rw_ekf.fit(_healthy(WHEEL, 1), noise=True).model
    log = _healthy(now, 2)
    run, fit = replay_log(log, model=before), rw_ekf.fit(log, prior=before)
    changed = max(times, key=lambda name: abs(math.log(times[name])))
    for belief, warnings in ((run.belief, run.warnings), (fit.belief, fit.warnings)):
        off = np.array(belief.parameters) - [now.motor_gain, now.viscous, now.coulomb, now.static]
        assert np.all(np.abs(off) < 3.5 * np.array(belief.parameter_std))
        (warning,) = (text for text in warnings if "contradict" in text)
        if len(times) == 1:
            assert f"({changed} " in warning


def test_a_diagnosis_says_what_has_changed_since_the_model_was_made() -> None:
    """Its advice is what a replay of a changed wheel says to ask: the answer names the number, and accuses no other."""
    before = rw_ekf.fit(_healthy(WHEEL, 1), noise=True).model
    changed = WHEEL._replace(coulomb=1.08 * WHEEL.coulomb, static=WHEEL.static + 0.08 * WHEEL.coulomb)
    same, other = (diagnose_log(_healthy(wheel, 2), model=before).document()["verdict"] for wheel in (WHEEL, changed))
    assert (same["kind"], other["kind"]) == ("adequate", "adequate")
    assert "has changed" not in same["statement"]
    said = other["statement"].partition(". ")[0]
    assert "has changed since the model given was made, or is another: coulomb 0.63" in said
    assert "motor_gain" not in said
    assert "viscous" not in said


def test_a_model_is_widened_until_it_bears_what_it_is_off_by() -> None:
    """Two numbers that it knows ten times as well as the log does, one fifty of the log's sigmas off: not drawn."""
    own, given = np.diag([1.0, 4.0]), np.diag([0.01, 0.04])
    off = np.array([50.0, 0.1])
    times = _birge(off, own, given)
    assert _apart(off, own + times * given) == pytest.approx(2.0, rel=1e-6)
    weight = np.linalg.inv(times * given) @ np.linalg.inv(np.linalg.inv(own) + np.linalg.inv(times * given))
    assert np.all(np.abs(weight @ off) < 0.05)  # of the log's sigmas


def _healthy(wheel: PlantParameters, seed: int) -> WheelLog:
    case = Case("healthy", "", "effects", (), (), wheel, "identification", 7, seed, 1.0, telemetry=False)
    return log_of(case)


@pytest.mark.slow
def test_break_away_under_a_lagging_friction_is_known_no_better_than_it_is() -> None:
    """Its jump is no slope for a fit and no certainty for a filter: it was 47 and 8 to 145 of its sigmas off."""
    effect = "friction_lag:time_constant_s=0.155839"
    first, second = (run_log(simulated([effect], seed=seed)) for seed in (52_865, 1_267_444))
    found = diagnose_log(first)
    assert found.verdict["effects"] == ["friction_lag"]
    assert found.model is not None
    parameters = found.model.parameters
    std = np.sqrt(np.diag(np.array(found.model.covariance)))[3]
    assert abs(parameters.static - WHEEL.static) < 3.0 * std
    assert 5.0e-4 < std < 5.0e-3
    run = replay_log(second, model=found.model)
    off = (run.belief.mean[PARAMETERS] - np.array(TRUTH.parameters)) / run.belief.std[PARAMETERS]
    assert np.all(np.abs(off) < 3.5), off
    assert not any("not noise" in warning for warning in run.warnings)


@pytest.mark.slow
def test_a_law_that_one_record_left_open_is_settled_by_the_next_or_left_open() -> None:
    """Viscous friction by temperature, linear, called exponential with .54: its slope was 32 sigma off in the next."""
    effect = "viscous_temperature:slope_1_K=-0.01714"
    first, second = (run_log(simulated([effect], seed=seed)) for seed in (85_998, 2_075_708))
    model = diagnose_log(first).model
    assert model is not None
    (term,) = model.effects.terms
    other = replace(term, shape=(1.0 - term.shape[0], 0.0, 0.0))
    for one in (term, other):
        run = replay_log(second, model=replace(model, effects=EffectSet((one,))))
        assert abs(run.belief.mean[5] + 0.01714) < 3.0 * run.belief.std[5]


def test_a_bristle_without_damping_goes_through_another_record() -> None:
    """Dahl's damping of 0 is another form and no number to settle: a replay of it ended in a traceback."""
    bristle = Term(CATALOGUE["presliding_hysteresis"], (0.015,), (0.002,))
    record = run_log(simulated(["presliding_hysteresis:deflection_rad=0.015,damping=0"], seed=3, samples=2000))
    covariance = tuple(tuple(row) for row in np.diag(np.square([0.01, 2.0e-5, 1.0e-3, 5.0e-3, 0.002])).tolist())
    known = WheelModel(
        FrictionParameters(*TRUTH.parameters), covariance, WHEEL.stribeck_speed_rad_s, effects=EffectSet((bristle,))
    )
    run = replay_log(record, model=known)
    assert run.setup.effects.terms[0].shape == bristle.shape
    assert abs(run.belief.mean[5] - 0.015) < 3.0 * run.belief.std[5]


DRIFT, TAU_S = 3.0e-4, 300.0  # rad/s^3: dry friction is 13 % more after ten minutes


def drifting(seed: int) -> WheelLog:
    """Ten minutes of a wheel that runs in."""
    return run_log(simulated([f"coulomb_drift:rate_rad_s3={DRIFT},time_constant_s={TAU_S}"], seed=seed))


def run_in(seed: int) -> WheelLog:
    """Ten minutes of it later: dry friction stays where the drift has left it."""
    more = DRIFT * TAU_S
    wheel = WHEEL._replace(coulomb=WHEEL.coulomb + more, static=WHEEL.static + more)
    return log_of(Case("run in", "", "effects", (), (), wheel, "identification", 7, seed, 1.0, telemetry=False))


def model_with(*terms: Term) -> WheelModel:
    """What a diagnosis of another record left, the numbers of its effects known to a hundredth."""
    parameters = FrictionParameters(WHEEL.motor_gain, WHEEL.viscous, WHEEL.coulomb, WHEEL.static)
    stds = [0.002, 1.0e-5, 5.0e-4, 2.0e-3, *(0.01 * abs(value) for term in terms for value in term.values)]
    covariance = tuple(tuple(row) for row in np.diag(np.square(stds)).tolist())
    return WheelModel(parameters, covariance, WHEEL.stribeck_speed_rad_s, effects=EffectSet(terms))


def drift_model() -> WheelModel:
    return model_with(Term(CATALOGUE["coulomb_drift"], (DRIFT,), (0.01 * DRIFT,), (TAU_S, 0.0, 0.0)))


def test_a_drift_that_is_over_is_not_forced_on_the_next_log() -> None:
    """A wheel that has run in: the replay leaves the drift out, says so, and finds its friction; adequate as it is."""
    log = run_in(5)
    run = replay_log(log, model=drift_model())
    assert run.setup.effects.terms == ()
    assert any("coulomb_drift of the model belonged to the record" in warning for warning in run.warnings)
    assert not any("not noise" in warning for warning in run.warnings)
    assert abs(run.belief.parameters.coulomb - WHEEL.coulomb - DRIFT * TAU_S) < 4.0 * run.belief.std[3]
    assert diagnose_log(log, model=drift_model()).verdict["kind"] == "adequate"


def test_a_drift_that_comes_again_is_kept() -> None:
    """A wheel that warms up in every run, this time by a fifth more: adequate with the drift, of its own size."""
    model = drift_model()
    smaller = replace(model, effects=EffectSet((replace(model.effects.terms[0], values=(DRIFT / 1.2,)),)))
    diagnosis = diagnose_log(drifting(6), model=smaller)
    assert diagnosis.verdict["kind"] == "adequate"
    entry = next(item for item in diagnosis.content["candidates"] if item["effect"] == "coulomb_drift")
    rate = entry["parameters"]["rate_rad_s3"]
    assert abs(rate["value"] - DRIFT) < 4.0 * rate["std"]


def test_a_spike_of_another_record_leaves_no_trace_in_one_without() -> None:
    """Drag that came once: the next log's replay is without it, and its sigmas are no wider for it."""
    known = replace(model(ONSET_S), covariance=drift_model().covariance)
    run = replay_log(run_log(simulated([], seed=7)), model=known)
    assert run.setup.effects.terms == ()
    assert run.setup.prior.covariance[PARAMETERS, PARAMETERS] == pytest.approx(np.array(known.covariance)[:4, :4])
    assert replay_log(run_in(7), model=known).setup.effects.terms == ()


def test_a_curve_over_time_of_one_record_is_not_that_of_another() -> None:
    """A viscous friction that wandered there and does not here: left out, and what it moved is open."""
    knots = tuple(0.2 * WHEEL.viscous * math.sin(2.0 * math.pi * i / 20.0) for i in range(21))
    law = Law("time", "viscous_drag", 0.0, 600.0, (knots,))
    run = replay_log(run_in(8), model=model_with(Term(LEARNED, (1.0,), (0.01,), law=law)))
    assert run.setup.effects.terms == ()
    assert not any("not noise" in warning for warning in run.warnings)
    assert abs(run.belief.parameters.viscous - WHEEL.viscous) < 4.0 * run.belief.std[2]


def test_a_run_begins_with_a_friction_that_a_drift_may_have_moved() -> None:
    """A run goes forward without the drift: dry friction is as open as it may have moved, c and s as one."""
    carried, notes = carried_over(drift_model())
    assert carried.effects.terms == ()
    assert any("coulomb_drift" in note for note in notes)
    covariance = np.array(carried.covariance)
    assert math.sqrt(covariance[2, 2]) == pytest.approx(math.hypot(0.2 * WHEEL.coulomb, 5.0e-4))
    assert math.sqrt(covariance[2, 2]) > 0.5 * DRIFT * TAU_S
    assert covariance[2, 3] == pytest.approx(covariance[2, 2], rel=0.01)
    assert covariance[0, 0] == pytest.approx(0.002**2)


@pytest.mark.parametrize("acts_as", ["motor_gain", "drag", "viscous_drag", "windage"])
def test_what_a_change_makes_of_the_parameters_is_known_as_the_two_together_are(acts_as: Any) -> None:
    """Value and covariance against draws of the model's numbers, each with its change applied; windage is in none."""
    law = Law("time", acts_as, 100.0, 100.01, ((1.0, 1.0),))
    change, other = (
        Term(CATALOGUE["change"], (-0.08,), (0.01,), law=law),
        Term.of(CATALOGUE["offset_torque"], value=0.1),
    )
    random = np.random.default_rng(5)
    root = random.normal(size=(6, 6)) * np.array([0.1, 1.0e-4, 0.01, 0.01, 0.01, 0.004])[:, None]
    rows = tuple(tuple(row) for row in (root @ root.T).tolist())
    model = WheelModel(FrictionParameters(14.0, 0.003, 0.5, 0.6), rows, 0.42, effects=EffectSet((other, change)))
    mean, covariance = parameters_by_now(model, model.effects)

    drawn = random.multivariate_normal([*model.parameters, 0.1, -0.08], root @ root.T, size=400_000)
    k, b, c, s, size = drawn[:, 0].copy(), drawn[:, 1].copy(), drawn[:, 2].copy(), drawn[:, 3].copy(), drawn[:, 5]
    if acts_as == "motor_gain":
        k *= 1.0 + size
    elif acts_as == "drag":
        c, s = c + size, s + size
    elif acts_as == "viscous_drag":
        b += size
    found = np.stack([k, b, c, s])
    stds = found.std(axis=1)
    assert np.all(np.abs(mean - found.mean(axis=1)) < 0.02 * stds)
    assert covariance / np.outer(stds, stds) == pytest.approx(np.cov(found) / np.outer(stds, stds), abs=0.02)
