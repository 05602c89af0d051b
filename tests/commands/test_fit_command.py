"""`rw-ekf fit`: the truth from a log, its noises, the experiments one by one, and what a log cannot tell."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.cli import main
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.model.effect import Term
from rw_ekf.model.state import CK13_STATISTICAL, PARAMETER_NAMES
from rw_ekf.wheel.effect_table import EffectSet
from rw_ekf.wheel.model_file import WheelModel, read_model
from tests.commands.documents import is_number, replay_document
from tests.commands.logs import coast_log, experiments_log, plant_columns, profile_log, write_columns
from tests.live.bench import document_of
from tools.measure.runs import OMEGA_S

TRUTH = dict(zip(PARAMETER_NAMES, CK13_STATISTICAL, strict=True))


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of profile P2."""
    return profile_log(tmp_path_factory.mktemp("logs") / "p2.csv")


def fitted(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    """The document of a fit that worked, checked."""
    assert main(["fit", *arguments, "--json"]) == 0
    document = document_of(capsys.readouterr().out)
    assert document["schema"] == "rw_ekf.fit/1"
    assert tuple(document["parameters"]) == PARAMETER_NAMES
    for parameter in document["parameters"].values():
        assert set(parameter) == {"value", "std", "unit", "prior_std", "identifiable"}
        assert is_number(parameter["value"])
        assert is_number(parameter["std"])
    size = 4 + len(document.get("effects", {}))
    assert [len(row) for row in document["covariance"]] == [size] * size
    return document


def test_least_squares_finds_the_truth(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each parameter of profile P2 within four sigma, converged, the residual as large as the noise."""
    document = fitted(capsys, str(log))
    for name, found in document["parameters"].items():
        assert abs(found["value"] - TRUTH[name]) < 4.0 * found["std"]
        assert found["identifiable"] is True
    assert document["converged"] is True
    assert document["residual_rms_rpm"] == pytest.approx(1.0, rel=0.1)
    assert document["noise"] is None
    assert "effects" not in document


def test_noise_is_found_too(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """--noise: the readings' one rpm within three sigma; the random walk that is not there is none or tiny."""
    noise = fitted(capsys, str(log), "--noise")["noise"]
    assert abs(noise["speed_noise_rpm"] - 1.0) < 3.0 * noise["speed_noise_std_rpm"]
    assert noise["acceleration_noise_rpm_per_sqrt_s"] < 0.1


def test_the_experiments_one_by_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """--method deterministic on drives and coast-downs from rest: gain and friction near the truth, starts counted."""
    document = fitted(capsys, str(experiments_log(tmp_path / "x.csv")), "--method", "deterministic")
    found = document["parameters"]
    assert found["motor_gain"]["value"] == pytest.approx(TRUTH["motor_gain"], rel=0.02)
    assert found["viscous"]["value"] == pytest.approx(TRUTH["viscous"], rel=0.3)
    assert found["coulomb"]["value"] == pytest.approx(TRUTH["coulomb"], rel=0.05)
    assert document["break_aways"] >= 1
    assert document["coast_down_s"] > 30.0


def test_a_fit_writes_a_model_that_starts_a_replay_and_the_next_fit(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """--out, then `replay --model` and `fit --prior` on another log: twice the data, smaller sigmas."""
    model, other = tmp_path / "wheel.model.yaml", profile_log(tmp_path / "other.csv", "P2", 9)
    first = fitted(capsys, str(log), "--out", str(model), "--noise")
    assert main(["replay", str(other), "--model", str(model), "--json"]) == 0
    replay_document(capsys.readouterr().out)
    second = fitted(capsys, str(other), "--prior", str(model))
    for name in PARAMETER_NAMES:
        assert second["parameters"][name]["std"] < first["parameters"][name]["std"]
        assert second["parameters"][name]["prior_std"] == pytest.approx(first["parameters"][name]["std"], rel=1e-9)


def test_the_effects_of_a_prior_are_fitted_told_and_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Offset and delay are in document, text and model; with that model a replay of another log finds them again."""
    prior, found = tmp_path / "prior.yaml", tmp_path / "found.yaml"
    truth = {"offset_torque": 0.03, "transport_delay": 0.12}
    effects = ["offset_torque:torque_rad_s2=0.03", "transport_delay:delay_s=0.12"]
    log, other = (
        str(write_columns(tmp_path / f"{seed}.csv", plant_columns("P2", effects, seed=seed))) for seed in (4, 5)
    )
    terms = (Term.of(CATALOGUE["offset_torque"], std=0.1), Term.of(CATALOGUE["transport_delay"], value=0.05, std=0.1))
    covariance = np.diag([0.0] * 4 + [0.01] * 2)
    covariance[:4, :4] = DEFAULT_PRIOR.parameter_covariance
    model = WheelModel(CK13_STATISTICAL, tuple(map(tuple, covariance.tolist())), OMEGA_S, effects=EffectSet(terms))
    prior.write_text(model.to_text(), encoding="utf-8")
    document = fitted(capsys, log, "--prior", str(prior), "--out", str(found))
    assert document["warnings"] == []
    assert list(document["effects"]) == list(truth)
    for name, item in document["effects"].items():
        assert abs(item["value"] - truth[name]) < 4.0 * item["std"] < 0.4 * truth[name]
    written = read_model(found)
    assert [term.values[0] for term in written.effects.terms] == [
        item["value"] for item in document["effects"].values()
    ]
    assert np.array_equal(written.covariance, document["covariance"])
    assert main(["replay", other, "--model", str(found), "--json"]) == 0
    (entry,) = replay_document(capsys.readouterr().out)["logs"]
    for name, item in entry["effects"].items():
        assert abs(item["value"] - truth[name]) < 4.0 * item["std"]
    assert main(["fit", log, "--prior", str(prior)]) == 0
    assert "  transport_delay: 0.1" in capsys.readouterr().out
    experiments = str(experiments_log(tmp_path / "x.csv"))
    bare = fitted(capsys, experiments, "--prior", str(prior), "--method", "deterministic")
    assert "effects" not in bare
    assert any("offset_torque, transport_delay" in text for text in bare["warnings"])


def test_without_a_current_the_gain_is_not_identifiable(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A coast-down says nothing of the motor: said in the document and in the text; Coulomb friction is found."""
    log = str(coast_log(tmp_path / "coast.csv"))
    found = fitted(capsys, log)["parameters"]
    assert found["motor_gain"]["identifiable"] is False
    assert found["coulomb"]["identifiable"] is True
    assert main(["fit", log]) == 0
    (line,) = (row for row in capsys.readouterr().out.splitlines() if "motor_gain" in row)
    assert "not identifiable" in line
