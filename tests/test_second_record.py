"""A model of one record in another: its shapes are the second record's, and a contradiction is said."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.cli import main
from rw_ekf.diagnosis.diagnose import diagnose_log
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_parameters import PlantParameters
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.log_replay import replay_log
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.effect import Term
from rw_ekf.model.state import PARAMETERS, FrictionParameters
from rw_ekf.wheel.effect_table import EffectSet
from rw_ekf.wheel.model_file import WheelModel
from tests.diagnosis.simulated import TRUTH, simulated
from tests.diagnosis.simulated import log_of as run_log
from tools.proof.cases import Case
from tools.proof.plants import log_of, save_log

WHEEL = PlantParameters()
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


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 2])
def test_break_away_under_a_lagging_friction_is_known_no_better_than_it_is(number: int) -> None:
    """Its jump is no slope for a fit and no certainty for a filter: it was 47 and 8 to 145 of its sigmas off."""
    effect = f"friction_lag:time_constant_s={(0.155839, 0.0, 0.202511)[number]}"
    first, second = (run_log(simulated([effect], seed=seed)) for seed in (52_865 + number, 1_267_444 + number))
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
