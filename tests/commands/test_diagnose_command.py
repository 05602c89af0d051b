"""`rw-ekf diagnose` from outside: its document, its files, and an augmented model that every other verb takes."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.cli import main
from rw_ekf.wheel.model_file import read_model
from tests.commands.documents import diagnosis_document, replay_document, run_document
from tests.commands.logs import plant_columns, write_columns
from tests.live.bench import ROOT, rw_ekf, served_wheel

pytestmark = pytest.mark.xdist_group("diagnose")  # one diagnosis serves many tests

TORQUE_RAD_S2 = 0.03  # 5 % of Coulomb friction; slows forward motion
FILES = {"diagnosis.json", "report.html", "cause.png", "speed.png", "residual.png", "evidence.svg"}
MODEL = "augmented-model.yaml"


@dataclass(frozen=True)
class Diagnosed:
    """A log, what `diagnose --json --out` said of it, and where its files are."""

    log: Path
    document: dict[str, Any]
    directory: Path

    @property
    def model(self) -> str:
        return str(self.directory / MODEL)


PROGRESS = re.compile(r"rw-ekf: .+: \d+ of \d+, \d+ s")


@pytest.fixture(scope="module")
def offset(tmp_path_factory: pytest.TempPathFactory) -> Diagnosed:
    """A wheel with an undeclared offset torque through P2, diagnosed in a process where every warning is an error."""
    place = tmp_path_factory.mktemp("offset")
    columns = plant_columns("P2", [f"offset_torque:torque_rad_s2={TORQUE_RAD_S2}"])
    log, directory = write_columns(place / "run.csv", columns), place / "new" / "diagnosis"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "rw_ekf", "diagnose", str(log), "--out", str(directory), "--json"],
        capture_output=True, text=True, cwd=ROOT, timeout=300, check=False,
    )  # fmt: skip
    warned = [line for line in done.stderr.splitlines() if not PROGRESS.fullmatch(line)]  # of a slow machine
    assert (done.returncode, warned) == (0, [])
    return Diagnosed(log, diagnosis_document(done.stdout), directory)


def diagnosed(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    """The document of a diagnosis in this process, where every warning is an error; nothing on standard error."""
    assert main(["diagnose", *arguments, "--json"]) == 0
    out, errors = capsys.readouterr()
    assert errors == ""
    return diagnosis_document(out)


def test_the_document_has_every_key_and_the_truth(offset: Diagnosed) -> None:
    """The effect is named, its coefficient within four sigma, the free-run error falls to the noise; numbers agree."""
    document = offset.document
    assert document["log"] == str(offset.log)
    assert document["samples"] == 3000
    assert document["rate_hz"] == pytest.approx(10.0)
    assert document["verdict"]["kind"] == "effect"
    assert document["verdict"]["effects"] == ["offset_torque"]
    (found,) = [candidate for candidate in document["candidates"] if candidate["effect"] == "offset_torque"]
    torque = found["parameters"]["torque_rad_s2"]
    assert torque["unit"] == "rad/s^2"
    assert 0.0 < torque["std"] < 0.001
    assert abs(torque["value"] - TORQUE_RAD_S2) < 4.0 * torque["std"]
    assert found["heldout_gain_percent"] > 50.0
    before, after = document["before"], document["after"]
    assert before["free_run_rms_rpm"] > 3.0
    assert after["free_run_rms_rpm"] == pytest.approx(1.0, abs=0.1)
    assert after["torque_rms_mNm"] < before["torque_rms_mNm"]


def test_fitted_and_held_out_stretches_alternate_over_the_whole_record(offset: Diagnosed) -> None:
    """Blocks of 40 s at least, every other one held out, none overlapping, from the first sample to the last."""
    split = offset.document["split"]
    assert split["kind"] == "blocks"
    spans = sorted([*split["fit_s"], *split["heldout_s"]])
    assert spans[::2] == split["fit_s"]
    assert spans[1::2] == split["heldout_s"]
    assert (spans[0][0], spans[-1][1]) == (0.0, pytest.approx(299.9))
    assert all(end - begin >= 39.8 for begin, end in spans)
    assert all(0.0 < after[0] - before[1] < 0.2 for before, after in pairwise(spans))


def test_out_leaves_the_document_a_page_without_network_pictures_and_the_model(offset: Diagnosed) -> None:
    """Every file is there; diagnosis.json is the document; the page names the effect and fetches nothing."""
    assert {path.name for path in offset.directory.iterdir()} == {*FILES, MODEL}
    assert json.loads((offset.directory / "diagnosis.json").read_text(encoding="utf-8")) == offset.document
    page = (offset.directory / "report.html").read_text(encoding="utf-8")
    assert "offset_torque" in page
    assert 'src="http' not in page
    assert "<link" not in page
    assert all((offset.directory / name).read_bytes()[:4] == b"\x89PNG" for name in FILES if name.endswith(".png"))
    model = read_model(Path(offset.model))
    assert model.effects.ids == ("offset_torque",)
    assert len(model.covariance) == 5


def test_replay_takes_the_model_and_knows_the_effect(offset: Diagnosed, capsys: pytest.CaptureFixture[str]) -> None:
    """replay --model: the coefficient is a state with its own sigma, near the truth; the residual is noise again."""
    entries = []
    for flag in ([], ["--model", offset.model]):
        assert main(["replay", str(offset.log), *flag, "--json"]) == 0
        entries += replay_document(capsys.readouterr().out)["logs"]
    without, with_it = entries
    torque = with_it["effects"]["offset_torque"]
    assert abs(torque["value"] - TORQUE_RAD_S2) < 4.0 * torque["std"] < 0.004
    assert with_it["innovation"]["rms_rpm"] < without["innovation"]["rms_rpm"]
    assert any("residual is not noise" in text for text in without["warnings"])
    (stated,) = with_it["warnings"]  # and nothing of the residual
    assert "the model given was made of this very log" in stated


def test_diagnosing_again_with_the_model_finds_nothing(offset: Diagnosed, capsys: pytest.CaptureFixture[str]) -> None:
    """diagnose --model: adequate, the effect is listed as known, the figures are those promised, and no model comes."""
    document = diagnosed(capsys, str(offset.log), "--model", offset.model)
    assert document["verdict"]["kind"] == "adequate"
    known = {c["effect"] for c in document["candidates"] if c["decision"] == "in the model already"}
    assert known == {"offset_torque"}
    promised = offset.document["after"]["free_run_rms_rpm"]
    assert document["before"]["free_run_rms_rpm"] == pytest.approx(promised, rel=0.05)
    assert document["after"] == document["before"]


def test_the_daemon_runs_with_the_model(offset: Diagnosed, tmp_path: Path) -> None:
    """filter.model: a run on a simulated wheel estimates the effect with the rest and passes it on in its own model."""
    with served_wheel(tmp_path) as bench:
        config = bench.config(filter={"model": offset.model})
        assert rw_ekf("check-config", str(config)).returncode == 0
        done = rw_ekf("run", "--config", str(config), "--duration", "1.0", "--json")
    assert done.returncode == 0
    document = run_document(done.stdout)
    torque = document["logs"][0]["effects"]["offset_torque"]
    assert torque["unit"] == "rad/s^2"
    assert 0.0 < torque["std"] < 0.001
    assert read_model(Path(document["model"])).effects.ids == ("offset_torque",)


def test_text_for_people_begins_with_the_verdict(offset: Diagnosed, capsys: pytest.CaptureFixture[str]) -> None:
    """Without --json: the statement, before -> after, the coefficient with sigma and unit; plain ASCII."""
    assert main(["diagnose", str(offset.log)]) == 0
    text = capsys.readouterr().out
    assert text.splitlines()[1].strip() == offset.document["verdict"]["statement"]
    assert all(part in text for part in ("before -> after", "free run" if "free run" in text else "Free run", "added"))
    assert "torque_rad_s2" in text
    assert text.isascii()


def test_halves_fit_the_first_and_judge_the_second(offset: Diagnosed, capsys: pytest.CaptureFixture[str]) -> None:
    """--split halves: one stretch each, in that order, and the effect is found from the first alone."""
    document = diagnosed(capsys, str(offset.log), "--split", "halves")
    ((begin, middle),) = document["split"]["fit_s"]
    ((after, end),) = document["split"]["heldout_s"]
    assert (begin, end) == (0.0, pytest.approx(299.9))
    assert middle < after
    assert middle == pytest.approx(150.0, abs=0.2)
    assert document["verdict"]["effects"] == ["offset_torque"]


def test_a_healthy_wheel_is_adequate_and_what_an_earlier_run_left_goes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing is added, before equals after, and a model of another log does not stay in the directory."""
    log, directory = write_columns(tmp_path / "log.csv", plant_columns("P2")), tmp_path / "out"
    directory.mkdir()
    (directory / MODEL).write_text("of another log", encoding="utf-8")
    document = diagnosed(capsys, str(log), "--out", str(directory))
    assert document["verdict"]["kind"] == "adequate"
    assert document["before"] == document["after"]
    assert document["before"]["free_run_rms_rpm"] == pytest.approx(1.0, abs=0.1)
    assert not (directory / MODEL).exists()
    assert {path.name for path in directory.iterdir()} <= FILES


def test_the_same_log_gives_the_same_document(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two diagnoses agree to the last bit, and neither changes the log."""
    log = write_columns(tmp_path / "log.csv", plant_columns("P1", seed=2))
    before = log.read_bytes()
    assert diagnosed(capsys, str(log)) == diagnosed(capsys, str(log))
    assert log.read_bytes() == before


def test_temperature_effects_need_a_temperature_that_moves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Not logged, or logged but constant: the three are listed as not testable, each for its own reason."""
    columns = plant_columns("P2")
    for warmth, reason in ((None, "not logged"), (25.0, "temperature")):
        if warmth is not None:
            columns["temperature_degC"] = np.full(columns["time_s"].size, warmth)
        document = diagnosed(capsys, str(write_columns(tmp_path / "log.csv", columns)))
        decisions = {c["effect"]: c["decision"] for c in document["candidates"]}
        for name in ("viscous_temperature", "coulomb_temperature", "motor_gain_temperature"):
            assert decisions[name].startswith("not testable: ")
            assert reason in decisions[name]


def test_a_model_s_own_file_may_be_replaced_by_a_better_one(
    offset: Diagnosed, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """--model DIR/augmented-model.yaml --out DIR: the second round of the loop in one directory is no overwriting."""
    model = tmp_path / MODEL
    model.write_text(Path(offset.model).read_text(encoding="utf-8"), encoding="utf-8")
    assert diagnosed(capsys, str(offset.log), "--model", str(model), "--out", str(tmp_path))["model"] is None
    assert (tmp_path / "report.html").exists()
