"""`--effect-file`: one line of a user's own is simulated, judged beside the catalogue, and lives on in the model."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from rw_ekf.cli import main
from tools.proof.uncatalogued_laws import Law, Made, Nameless

FILE = (
    'eddy: {drag: "a * omega / (1 + (omega / w0)**2)", a: {unit: 1/s}, w0: {unit: rad/s, start: 50, range: [1, 500]}}\n'
)
A, W0 = 0.004, 30.0  # of the wheel that has it: 10 % of Coulomb friction at 30 rad/s


class _Eddy(Nameless):
    """A wheel with eddy currents, by an integrator that knows neither the estimator nor its formulas."""

    @property
    def law(self) -> Law:
        return lambda met: Made(drag=A * abs(met.omega) / (1.0 + (met.omega / W0) ** 2))


@pytest.fixture
def effect_file(tmp_path: Path) -> str:
    path = tmp_path / "my-effects.yaml"
    path.write_text(FILE)
    return str(path)


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one sentence of a refusal."""
    assert main(arguments) == 2
    out, errors = capsys.readouterr()
    assert out == ""
    assert errors.count("\n") == 1
    return errors


@pytest.mark.parametrize(
    "verb", [["diagnose", "no.csv"], ["simulate", "--link", "wheel"]], ids=["diagnose", "simulate"]
)
def test_a_wrong_file_ends_either_verb_with_its_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Status 2, file, line and column, before any work."""
    monkeypatch.chdir(tmp_path)
    Path("my.yaml").write_text(FILE.replace("omega / (1", "omeg / (1"))
    assert "my.yaml:1:19: eddy.drag has the unknown name 'omeg'" in refused(capsys, *verb, "--effect-file", "my.yaml")
    assert "no such file" in refused(capsys, *verb, "--effect-file", "none.yaml")


@pytest.mark.parametrize(
    ("effect", "stated"),
    [("eddy", "needs a"), ("eddy:w=2", "'w'"), ("eddy:a=fast", "number"), ("no:a=1", "unknown effect")],
)
def test_a_simulated_wheel_needs_its_numbers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], effect_file: str, effect: str, stated: str
) -> None:
    """Status 2, one sentence, no link."""
    link = str(tmp_path / "wheel")
    assert stated in refused(capsys, "simulate", "--link", link, "--effect-file", effect_file, "--effect", effect)


def log_file(case: Nameless, path: Path) -> str:
    """The case's log as CSV."""
    case.log().save(path)
    return str(path)


@pytest.mark.slow
def test_a_hypothesis_of_one_line_is_named_and_lives_on_in_the_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], effect_file: str
) -> None:
    """Named with size and constant in document, page and model; that explains the next log without the file."""
    log, out = log_file(_Eddy("eddy", 11), tmp_path / "eddy.csv"), tmp_path / "out"
    assert main(["diagnose", log, "--effect-file", effect_file, "--out", str(out), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    verdict = document["verdict"]
    assert verdict["effects"] == ["eddy"], verdict["statement"]
    assert verdict["posterior"]["eddy"] > 0.7
    assert "drag = a * omega / (1 + (omega / w0)**2)" in verdict["statement"]
    (found,) = [item for item in document["candidates"] if item["effect"] == "eddy"]
    size, where = found["parameters"]["a"], found["parameters"]["w0"]
    assert abs(size["value"] - A) < 4.0 * size["std"] < A
    assert math.isclose(where["value"], W0, rel_tol=0.2)
    assert document["ledger"]
    assert "eddy" in (out / "report.html").read_text(encoding="utf-8")
    assert (out / "cause.png").exists()
    model = str(out / "augmented-model.yaml")
    following = log_file(_Eddy("eddy", 12), tmp_path / "next.csv")
    assert main(["replay", following, "--model", model, "--json"]) == 0
    replayed = json.loads(capsys.readouterr().out)["logs"][0]
    assert replayed["effects"]["eddy"]["unit"] == "1/s"
    assert abs(replayed["effects"]["eddy"]["value"] - A) < 4.0 * replayed["effects"]["eddy"]["std"]
    assert 0.9 < replayed["innovation"]["nis_mean"] < 1.1
    assert main(["fit", following, "--prior", model, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["effects"]["eddy"]["value"] == pytest.approx(A, rel=0.1)
    assert main(["diagnose", following, "--model", model, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"]["kind"] == "adequate"
    Path(effect_file).write_text(FILE.replace("**2", ""))
    assert "by another formula" in refused(capsys, "diagnose", log, "--model", model, "--effect-file", effect_file)


@pytest.mark.slow
def test_a_healthy_wheel_is_not_accused_of_a_hypothesis(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], effect_file: str
) -> None:
    """It stands among the candidates, with nothing behind it."""
    log = log_file(Nameless("healthy", 13), tmp_path / "healthy.csv")
    assert main(["diagnose", log, "--effect-file", effect_file, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["verdict"]["kind"] == "adequate"
    (found,) = [item for item in document["candidates"] if item["effect"] == "eddy"]
    assert found["decision"] == "not significant"
