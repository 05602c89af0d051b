"""Bad input through the command line: status 2, one clear sentence with file and place, nothing on standard output."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.cli import main
from tests.commands.documents import replay_document
from tests.commands.logs import HEADER, profile_log, write_log
from tests.truth import run_of

ROWS = [f"{0.1 * i:.1f},{10 + 0.1 * i:.2f},0.05" for i in range(200)]


def text_of(rows: list[str], header: str = HEADER) -> bytes:
    return ("\n".join([header, *rows]) + "\n").encode()


def with_row(index: int, row: str) -> bytes:
    return text_of([*ROWS[:index], row, *ROWS[index + 1 :]])


# name: content of the file, and what the one sentence must contain beside the file's name
BAD_LOGS: dict[str, tuple[str, bytes, tuple[str, ...]]] = {
    "missing column": ("a.csv", text_of(ROWS, "time_s,speed_rad_s,amps"), ("current_command_A",)),
    "missing speed": ("a.csv", text_of(ROWS, "time_s,omega,current_command_A"), ("speed",)),
    "missing time": ("a.csv", text_of(ROWS, "t,speed_rad_s,current_command_A"), ("time_s",)),
    "text in a cell": ("a.csv", with_row(40, "4.0,fast,0.05"), ("line 42", "speed_rad_s", "fast")),
    "text in the current": ("a.csv", with_row(40, "4.0,14,strong"), ("line 42", "current_command_A", "strong")),
    "empty time": ("a.csv", with_row(40, ",14,0.05"), ("line 42", "time_s")),
    "infinity": ("a.csv", with_row(7, "0.7,inf,0.05"), ("line 9", "speed_rad_s", "inf")),
    "infinite current": ("a.csv", with_row(7, "0.7,10,-inf"), ("line 9", "current_command_A", "inf")),
    "time backwards": ("a.csv", text_of(ROWS[100:] + ROWS[:100]), ("backward", "line 102", "segment")),
    "empty file": ("a.csv", b"", ("empty",)),
    "header alone": ("a.csv", (HEADER + "\n").encode(), ("a.csv",)),
    "no current at all": ("a.csv", text_of([f"{0.1 * i:.1f},{i}," for i in range(50)]), ("current_command_A",)),
    "no speed at all": ("a.csv", text_of([f"{0.1 * i:.1f},,0.1" for i in range(50)]), ("speed",)),
    "negative delay": (
        "a.csv",
        text_of(["0,1,0.1,0", "0.1,1,0.1,-0.5"], HEADER + ",command_delay_s"),
        ("line 3", "command_delay_s"),
    ),
    "too many fields": ("a.csv", with_row(40, "4.0,14,0.05,9,9"), ("line 42",)),
    "not Parquet": ("a.parquet", b"PAR1" + bytes(60), ("a.parquet",)),
    "text called Parquet": ("a.parquet", b"hello\n", ("a.parquet",)),
    "not MATLAB": ("a.mat", b"MATLAB 5.0 MAT-file" + bytes(200), ("a.mat",)),
    "zeros": ("a.csv", bytes(500), ("a.csv",)),
    "a picture": ("a.csv", b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 4, ("a.csv",)),
}


def refused(capsys: pytest.CaptureFixture[str], *arguments: str, status: int = 2) -> str:
    """The one sentence of a refusal."""
    assert main(arguments) == status
    out, errors = capsys.readouterr()
    assert out == ""
    assert "Traceback" not in errors
    assert errors.startswith("rw-ekf: error: ")
    assert errors.count("rw-ekf: error: ") == 1
    assert errors.count("\n") == 1
    return errors


@pytest.mark.parametrize("verb", ["replay", "fit", "diagnose", "export"])
@pytest.mark.parametrize("name", BAD_LOGS)
def test_a_bad_log_is_refused_with_its_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, verb: str
) -> None:
    """Every verb that reads logs says file, place and what was found, in one sentence, and leaves no output behind."""
    file_name, content, expected = BAD_LOGS[name]
    if verb in {"export", "diagnose"} and name == "no speed at all":
        pytest.skip("a log without a speed can be converted, and a diagnosis says that it cannot be judged")
    names = {"fit": "out.yaml", "diagnose": "out"}
    log, out = tmp_path / file_name, tmp_path / names.get(verb, "out.csv")
    log.write_bytes(content)
    target = [str(out)] if verb == "export" else ["--out", str(out)]
    message = refused(capsys, verb, str(log), *target)
    assert str(log) in message
    for text in expected:
        assert text in message
    assert not out.exists()


@pytest.mark.parametrize("verb", ["replay", "fit", "diagnose"])
def test_a_log_that_is_not_there_or_a_directory(tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str) -> None:
    """A name that leads nowhere, and one that leads to a directory, are named."""
    assert "nowhere.csv" in refused(capsys, verb, str(tmp_path / "nowhere.csv"))
    assert "directory" in refused(capsys, verb, str(tmp_path))


def test_a_truncated_last_line_is_dropped_with_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A log cut in its last line (a power cut) is replayed without it."""
    log = tmp_path / "cut.csv"
    log.write_bytes(text_of(ROWS) + b"20.0,30")
    assert main(["replay", str(log), "--json"]) == 0
    (entry,) = replay_document(capsys.readouterr().out)["logs"]
    assert entry["samples"] == 200
    assert any("last line" in text for text in entry["warnings"])


def test_one_sample_replays_to_the_prior_with_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One row: a whole document of numbers, nothing identifiable, and a sentence about it."""
    log = tmp_path / "one.csv"
    log.write_bytes(text_of(ROWS[:1]))
    assert main(["replay", str(log), "--json"]) == 0
    (entry,) = replay_document(capsys.readouterr().out)["logs"]
    assert entry["samples"] == 1
    assert not any(entry["identifiable"].values())
    assert entry["warnings"]


@pytest.mark.parametrize("speed_rpm", [0.0, 1000.0])
def test_a_constant_speed_is_no_failure(tmp_path: Path, capsys: pytest.CaptureFixture[str], speed_rpm: float) -> None:
    """A wheel that stands, and one that holds 1000 rpm exactly: numbers throughout, and nothing claimed of the gain."""
    time_s = 0.1 * np.arange(600, dtype=np.float64)
    current = np.zeros(600) if speed_rpm == 0.0 else np.full(600, 0.0612)
    log = write_log(tmp_path / "constant.csv", [time_s, np.full(600, speed_rpm * np.pi / 30), current])
    assert main(["replay", str(log), "--json"]) == 0
    (entry,) = replay_document(capsys.readouterr().out)["logs"]
    assert entry["identifiable"]["motor_gain"] is False
    assert main(["fit", str(log), "--json"]) in (0, 1)
    assert "Traceback" not in capsys.readouterr().err


def test_places_to_write_are_checked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """--out with an unknown ending, in a directory that is not there, and onto a directory: each a sentence."""
    log = str(profile_log(tmp_path / "p2.csv", samples=300))
    assert ".csv, .parquet, .mat" in refused(capsys, "replay", log, "--out", str(tmp_path / "out.txt"))
    assert "cannot be written" in refused(capsys, "replay", log, "--out", str(tmp_path / "no" / "out.csv"))
    (tmp_path / "dir.csv").mkdir()
    assert "directory" in refused(capsys, "replay", log, "--out", str(tmp_path / "dir.csv"))
    assert "cannot be written" in refused(capsys, "fit", log, "--out", str(tmp_path / "no" / "model.yaml"))
    assert ".csv, .parquet, .mat" in refused(capsys, "export", log, str(tmp_path / "out.xlsx"))


def test_options_that_do_not_go_together(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """--smooth without --out, and --smooth with --online."""
    log = str(profile_log(tmp_path / "p2.csv", samples=300))
    assert "--out" in refused(capsys, "replay", log, "--smooth")
    assert "--online" in refused(capsys, "replay", log, "--smooth", "--online", "--out", str(tmp_path / "o.csv"))


@pytest.mark.parametrize("verb", ["replay", "fit", "diagnose"])
def test_a_wheel_of_no_configuration_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str) -> None:
    """--wheel names a wheel of --config: without one it said nothing of the log, and is no longer passed over."""
    log = str(profile_log(tmp_path / "p2.csv", samples=300))
    stated = refused(capsys, verb, log, "--wheel", "rw-y")
    assert "--wheel rw-y: names one of the wheels of a configuration, and there is none: give --config" in stated
    assert "a column map says which" in stated
    assert "--wheel rw-y" in refused(capsys, "simulate", "--link", str(tmp_path / "wheel"), "--wheel", "rw-y")


def change_model(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new)


BAD_MODELS: dict[str, tuple[Callable[[str], str], str]] = {
    "another version": (lambda t: change_model(t, "rw_ekf.model/1", "rw_ekf.model/7"), "rw_ekf.model/7"),
    "no model": (lambda t: "schema: rw_ekf.replay/1\n", "not a model file"),
    "a list": (lambda t: "- 1\n- 2\n", "mapping"),
    "empty": (lambda t: "", "empty"),
    "covariance of another shape": (lambda t: t[: t.index("covariance:")] + "covariance: [[1, 0], [0, 1]]\n", "4 rows"),
    "covariance that is none": (
        lambda t: (
            t[: t.index("covariance:")]
            + "covariance: [[1, 9, 0, 0], [9, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\nnoise: {speed_rad_s: 0.1}\n"
        ),
        "covariance",
    ),
    "covariance of nothing": (
        lambda t: t[: t.index("covariance:")] + "covariance: [[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,0]]\n",
        "covariance",
    ),
    "covariance of texts": (
        lambda t: t[: t.index("covariance:")] + 'covariance: [["1",0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n',
        "covariance",
    ),
    "unknown law": (lambda t: change_model(t, "law: gauss", "law: cubic"), "cubic"),
    "effects of the future": (
        lambda t: change_model(t, "effects: []", "effects: [{effect: warp, coefficient: {value: 1, std: 1, unit: m}}]"),
        "effects.0.effect must be one of",
    ),
    "unknown key": (lambda t: t + "colour: red\n", "colour"),
    "broken YAML": (lambda t: t + "a: [1\n", "model.yaml"),
}


@pytest.mark.parametrize("name", BAD_MODELS)
def test_a_bad_model_is_refused_with_its_place(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    """A model from another version, with a covariance that is none, with unknown keys: the place and what to do."""
    log, model = profile_log(tmp_path / "p2.csv", samples=600), tmp_path / "model.yaml"
    assert main(["fit", str(log), "--out", str(model)]) == 0
    capsys.readouterr()
    change, expected = BAD_MODELS[name]
    model.write_text(change(model.read_text(encoding="utf-8")), encoding="utf-8")
    message = refused(capsys, "replay", str(log), "--model", str(model))
    assert str(model) in message
    assert expected in message
    refused(capsys, "fit", str(log), "--prior", str(model))


def test_a_good_log_is_read_after_all_that(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same rows without a fault replay without a warning of reading."""
    log = tmp_path / "good.csv"
    run = run_of("P1", 1)
    write_log(log, [run.time_s[:300], run.reading_rad_s[:300], run.current_A[:300]])
    assert main(["replay", str(log), "--json"]) == 0
    assert replay_document(capsys.readouterr().out)["logs"][0]["warnings"] == []
