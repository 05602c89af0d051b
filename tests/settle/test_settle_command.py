"""`rw-ekf excite --settle`: what it refuses, what it shows, and a whole run that settles what a log left open."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.cli import main
from rw_ekf.commands.settle import _from_here
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.settings.load import load_configuration
from rw_ekf.settle.standing_explanations import standing_of_document
from tests.contract import check_document
from tests.diagnosis.simulated import log_of, simulated
from tests.live.bench import write_config
from tests.settle.rig import designed, run
from tests.settle.standing import LAG_OR_DELAY, diagnosis, model, write

LAG = model(("actuator_lag", 0.05, 0.002))
SLOW: dict[str, dict[str, Any]] = {"loop": {"rate_hz": 2.0}, "limits": {"silence_s": 1.5}}


def spoilt(**changes: Any) -> dict[str, Any]:
    """A document with some keys otherwise."""
    return {**LAG_OR_DELAY, **changes}


def first_with(**changes: Any) -> dict[str, Any]:
    """The same with some keys of its first explanation otherwise."""
    first, *rest = LAG_OR_DELAY["explanations"]
    return spoilt(explanations=[{**first, **changes}, *rest])


BAD: dict[str, tuple[Any, str]] = {
    "not JSON": ("{", "not a diagnosis"),
    "a list": ([1, 2], "not a diagnosis"),
    "another document": ({"schema": "rw_ekf.fit/1"}, "'rw_ekf.fit/1'"),
    "deep": ("[" * 100_000, "not a diagnosis"),
    "of an older version": ({"schema": "rw_ekf.diagnosis/1"}, "diagnose the log again"),
    "nothing stands": (diagnosis(kind="insufficient_excitation"), "excite identification"),
    "unexplained": (diagnosis(kind="unexplained"), "nothing to tell apart"),
    "one stands": (diagnosis((1.0, LAG)), "only one explanation stands (actuator_lag)"),
    "an explanation is no object": (spoilt(explanations=[1, 2]), "explanations[0]"),
    "no probability": (first_with(posterior="high"), "explanations[0].posterior is 'high'"),
    "a number beyond all": (first_with(posterior=10**400), "explanations[0].posterior"),
    "no model": (first_with(model=None), "explanations[0].model"),
    "a model of nothing": (first_with(model={"schema": "rw_ekf.model/1"}), "explanations[0].model"),
    "an effect that its model has not": (first_with(effects=["magic"]), "explanations[0].effects names magic"),
    "no end": (spoilt(ended=None), "`ended.time_s`, when the log ended, is missing"),
    "an end beyond all time": (spoilt(ended={"time_s": 1e308}), "is 1e+308 s"),
    "an effect unknown": (first_with(model={**LAG.document(), "effects": [{"effect": "magic"}]}), "'magic'"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_open_diagnosis_is_refused_in_words(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """Status 2, the file and what to do, nothing on standard output, no traceback."""
    content, stated = BAD[name]
    path = tmp_path / "diagnosis.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    config = str(write_config(tmp_path, str(tmp_path / "nowhere")))
    assert main(["excite", "--settle", str(path), "--config", config]) == 2
    out, errors = capsys.readouterr()
    assert out == ""
    assert "Traceback" not in errors
    assert str(path) in errors
    assert stated in errors


def test_usage_that_makes_no_sense_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Neither or both of profile and diagnosis, a dry run of a profile, no file, no limits, a loop too slow."""
    config = str(write_config(tmp_path, str(tmp_path / "nowhere")))
    path = write(tmp_path / "diagnosis.json", LAG_OR_DELAY)
    bare = tmp_path / "bare.yaml"
    bare.write_text("wheel: {port: /dev/null}\n", encoding="utf-8")
    slow = tmp_path / "slow"
    slow.mkdir()
    slow_config = str(write_config(slow, "nowhere", loop={"rate_hz": 1.0}, limits={"silence_s": 3.0}))
    for arguments, stated in (
        (["--config", config], "name either"),
        (["S2", "--settle", path, "--config", config], "name either"),
        (["S2", "--dry-run", "--config", config], "--dry-run"),
        (["--settle", str(tmp_path / "none.json"), "--config", config], "cannot be read"),
        (["--settle", str(tmp_path), "--config", config], "cannot be read"),
        (["--settle", path, "--config", str(bare)], "limits"),
        (["--settle", path, "--config", slow_config], "loop.rate_hz"),
    ):
        assert main(["excite", *arguments]) == 2, arguments
        out, errors = capsys.readouterr()
        assert out == ""
        assert stated in errors
        assert "Traceback" not in errors


def test_a_dry_run_shows_the_design_and_moves_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Status 0, the document of the contract, expected times within two minutes, no log and no port opened."""
    config = str(write_config(tmp_path, str(tmp_path / "nowhere"), **SLOW))
    path = write(tmp_path / "diagnosis.json", LAG_OR_DELAY)
    assert main(["excite", "--settle", path, "--config", config, "--dry-run", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    check_document(document)
    assert document["separates"]
    assert [item["effects"] for item in document["explanations"]] == [["actuator_lag"], ["transport_delay"]]
    assert all(item["settled_s"] <= 120.0 for item in document["explanations"])
    assert document["most"]["current_A"] <= 0.6
    assert sorted(item.name for item in tmp_path.iterdir()) == ["diagnosis.json", "wheel.yaml"]


def test_what_no_motion_tells_apart_is_not_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two explanations that are one: refused with status 1 and what to do, before a port is opened."""
    same = diagnosis((0.5, LAG), (0.5, LAG))
    config = str(write_config(tmp_path, str(tmp_path / "nowhere"), **SLOW))
    path = write(tmp_path / "diagnosis.json", same)
    assert main(["excite", "--settle", path, "--config", config]) == 1
    out, errors = capsys.readouterr()
    assert out == ""
    assert "no motion within the limits" in errors


def test_what_no_motion_tells_apart_is_not_called_settled(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Shown without a move: no time, no better chances, no two minutes of motion to look at."""
    same = diagnosis((0.5, LAG), (0.5, LAG))
    config = str(write_config(tmp_path, str(tmp_path / "nowhere"), **SLOW))
    path = write(tmp_path / "diagnosis.json", same)
    assert main(["excite", "--settle", path, "--config", config, "--dry-run", "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    check_document(document)
    assert not document["separates"]
    assert [item["settled_s"] for item in document["explanations"]] == [None, None]
    assert [item["expected_posterior"] for item in document["explanations"]] == [0.5, 0.5]
    assert document["expected_probability"] == 0.5
    assert main(["excite", "--settle", path, "--config", config, "--dry-run"]) == 1
    stated = capsys.readouterr().out
    assert "motion, from rest" not in stated
    assert stated.count("not settled") == 2


def test_the_command_at_the_end_names_logs_as_this_folder_sees_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Diagnosed in one folder and settled in another: the path of the first log is turned, a blank in it quoted."""
    (tmp_path / "made" / "found").mkdir(parents=True)
    (tmp_path / "made" / "a log.csv").touch()
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    diagnosed = str(tmp_path / "made" / "found" / "diagnosis.json")
    assert _from_here("a log.csv", diagnosed) == "'../made/a log.csv'"
    assert _from_here("gone.csv", diagnosed) == "gone.csv"


@pytest.mark.slow
def test_a_whole_run_settles_what_a_first_log_left_open(tmp_path: Path) -> None:
    """Slow sines leave a lag beside a delay and a mean; both logs together say which it is, as the design expected."""
    first = log_of(simulated(["actuator_lag"], seed=11, profile="P1"))
    document = diagnose_log(first).document()
    config = load_configuration(write_config(tmp_path, "nowhere"))
    plan = designed(standing_of_document("first", document), config, looked_at=60)
    assert plan.separates
    second = run(config, plan, parse_effects(["actuator_lag"]), 0.0)
    both = diagnose_log([first, second]).document()
    top = both["explanations"][0]
    assert top["effects"] == ["actuator_lag"]
    assert top["posterior"] > 0.95
    assert both["verdict"]["effects"] == ["actuator_lag"]
