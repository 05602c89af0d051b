"""`rw-ekf replay`: the document, the table, smoothing, the online way, and records of another size."""

from __future__ import annotations

import math
import os
import pickle
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyarrow import csv, parquet

from rw_ekf.cli import main
from rw_ekf.commands import log_replays
from rw_ekf.errors import ConfigError
from tests.commands.documents import STATE, replay_document
from tests.commands.logs import CARRIAGE_MAP, carriage_log, coast_log, profile_log, write_log
from tests.truth import run_of

COLUMNS = [
    "time_s", *STATE, *(f"std_{key}" for key in STATE),
    "innovation_rad_s", "innovation_std_rad_s", "nis", "accepted", "reason",
]  # fmt: skip


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of profile P2."""
    return profile_log(tmp_path_factory.mktemp("logs") / "p2.csv")


def replayed(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    """The document of a replay that worked."""
    assert main(["replay", *arguments, "--json"]) == 0
    return replay_document(capsys.readouterr().out)


def test_the_document_has_every_key_and_finds_the_truth(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All keys of the contract, and each parameter within four sigma of the truth."""
    (entry,) = replayed(capsys, str(log))["logs"]
    truth = dict(zip(STATE[1:], run_of("P2", 4).parameters, strict=True))
    assert entry["log"] == str(log)
    assert (entry["samples"], entry["missing"], entry["rejected"]) == (len(run_of("P2", 4).time_s), 0, 0)
    assert entry["warnings"] == []
    for name, value in truth.items():
        assert abs(entry["state"][name] - value) < 4.0 * entry["std"][name]
    assert all(entry["identifiable"].values())
    for (name, value), key in zip(entry["physical"].items(), STATE[1:], strict=True):
        assert value == pytest.approx(1.5e-3 * entry["state"][key]), name


def test_online_says_what_the_compiled_pass_says(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Every number of the document agrees to a millionth of a sigma, every count exactly."""
    (one,), (two,) = (replayed(capsys, str(log), *flag)["logs"] for flag in ([], ["--online"]))
    for key in STATE:
        assert abs(one["state"][key] - two["state"][key]) < 1e-6 * one["std"][key]
        assert one["std"][key] == pytest.approx(two["std"][key], rel=1e-6)
    for key in ("samples", "missing", "rejected", "duration_s", "identifiable", "warnings"):
        assert one[key] == two[key]


@pytest.mark.parametrize("online", [[], ["--online"]])
def test_the_table_has_the_contract_s_columns(log: Path, tmp_path: Path, online: list[str]) -> None:
    """One row per sample in the order of the contract; the last row is where the document ends."""
    out = tmp_path / "out.csv"
    assert main(["replay", str(log), "--out", str(out), *online]) == 0
    table = csv.read_csv(out)
    assert table.column_names == COLUMNS
    assert table.num_rows == len(run_of("P2", 4).time_s)
    assert table["reason"][0].as_py() == "first"
    assert table["accepted"][1].as_py() is True
    assert table["innovation_rad_s"].null_count == 1


def test_several_logs_share_a_table_whose_first_column_names_them(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two logs: two entries, one Parquet table, first column `log`; each log starts from the prior."""
    other, out = profile_log(tmp_path / "p1.csv", "P1", 2), tmp_path / "out.parquet"
    document = replayed(capsys, str(log), str(other), "--out", str(out))
    table = parquet.read_table(out)
    assert table.column_names == ["log", *COLUMNS]
    names = table["log"].to_pylist()
    assert [names[0], names[-1]] == [str(log), str(other)]
    assert [entry["samples"] for entry in document["logs"]] == [names.count(str(log)), names.count(str(other))]
    (alone,) = replayed(capsys, str(other))["logs"]
    assert alone["state"] == document["logs"][1]["state"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of logs that no run of ours wrote: one a Parquet file, and beside them what is no log."""
    folder = tmp_path_factory.mktemp("folder")
    for seed in range(5):
        profile_log(folder / f"{seed}.csv", "P1", seed, samples=600)
    parquet.write_table(csv.read_csv(folder / "3.csv"), folder / "3.parquet")
    (folder / "3.csv").unlink()
    (folder / "notes.txt").write_text("of the week\n", encoding="utf-8")
    (folder / ".hidden.csv").write_text("what a cloud leaves\n", encoding="utf-8")
    return folder


def test_a_folder_of_plain_logs_is_each_of_them(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By name, in whatever form, each as if it had been named itself."""
    entries = replayed(capsys, str(folder))["logs"]
    assert [Path(entry["log"]).stem for entry in entries] == ["0", "1", "2", "3", "4"]
    assert entries[2]["state"] == replayed(capsys, str(folder / "2.csv"))["logs"][0]["state"]


@pytest.mark.parametrize("verbose", [[], ["-v"]])
def test_many_logs_on_all_cores_say_what_they_say_one_by_one(
    folder: Path, verbose: list[str], capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same document but for the seconds, in the same order; what -v tells of each log reaches standard error."""
    assert main(["replay", str(folder), "--json", *verbose]) == 0
    alone = replay_document(capfd.readouterr().out)
    monkeypatch.setattr(log_replays, "_SHARED_S", 0.0)
    assert main(["replay", str(folder), "--json", *verbose]) == 0
    shared = capfd.readouterr()
    assert replay_document(shared.out)["logs"] == alone["logs"]
    assert ("has read" in shared.err) == bool(verbose)
    assert all(f"{stem}." in shared.err for stem in range(5) if verbose)


def test_a_bad_log_among_many_is_refused_as_it_is_alone(
    folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same sentences and status from a process of its own, each finding by itself."""
    for path in folder.glob("[0-2].csv"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / "2.csv").write_text("time_s,speed_rad_s,current_A\n0,1,0\n1,nonsense,0\n", encoding="utf-8")
    stated = []
    for shared_s in (2.0, 0.0):
        monkeypatch.setattr(log_replays, "_SHARED_S", shared_s)
        assert main(["replay", str(tmp_path), "--json"]) == 2
        stated.append(capfd.readouterr().out)
    assert stated[0] == stated[1]
    assert "nonsense" in stated[0]
    error = ConfigError(["one", "two"])
    assert pickle.loads(pickle.dumps(error)).findings == error.findings


def _ended(*_: object) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_process_that_is_killed_is_a_sentence(
    folder: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a system short of memory does it: exit status 1, and no traceback."""
    monkeypatch.setattr(log_replays, "_SHARED_S", 0.0)
    monkeypatch.setattr(log_replays, "partial", lambda *_, **__: _ended)
    assert main(["replay", str(folder)]) == 1
    stated = capfd.readouterr().err
    assert "fewer logs at a time" in stated
    assert "Traceback" not in stated


def test_smoothing_adds_columns_and_knows_more(log: Path, tmp_path: Path) -> None:
    """`--smooth`: ten more columns; hindsight is never less certain, and ends where the filter ends."""
    out = tmp_path / "out.parquet"
    assert main(["replay", str(log), "--out", str(out), "--smooth"]) == 0
    table = parquet.read_table(out)
    smoothed = [f"smoothed_{key}" for key in STATE] + [f"std_smoothed_{key}" for key in STATE]
    assert table.column_names == [*COLUMNS, *smoothed]
    for key in STATE:
        before, after = (table[name].to_numpy() for name in (f"std_{key}", f"std_smoothed_{key}"))
        assert np.all(after <= before * (1.0 + 1e-9))
        assert table[f"smoothed_{key}"].to_numpy()[-1] == pytest.approx(table[key].to_numpy()[-1], rel=1e-12)


def test_a_model_starts_the_next_replay(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`fit --out` then `replay --model`: the sigmas begin where the fit ended, and only shrink."""
    model = tmp_path / "wheel.model.yaml"
    assert main(["fit", str(log), "--out", str(model)]) == 0
    capsys.readouterr()
    (without,), (with_it,) = (replayed(capsys, str(log), *flag)["logs"] for flag in ([], ["--model", str(model)]))
    assert all(with_it["std"][key] < without["std"][key] for key in STATE[1:])


def test_gaps_and_spikes_are_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Ten empty speeds and three spikes: `missing` 10, `rejected` 3, the table says missing and gate, numbers stay."""
    run = run_of("P2", 4)
    speed = run.reading_rad_s.copy()
    speed[500:510] = np.nan
    speed[[700, 900, 1100]] += 30.0
    log, out = write_log(tmp_path / "log.csv", [run.time_s, speed, run.current_A]), tmp_path / "out.csv"
    (entry,) = replayed(capsys, str(log), "--out", str(out))["logs"]
    assert (entry["missing"], entry["rejected"]) == (10, 3)
    reasons = csv.read_csv(out)["reason"].to_pylist()
    assert (reasons.count("missing"), reasons.count("gate"), reasons.count("first")) == (10, 3, 1)


def test_a_record_of_another_size_tells_its_own_scales(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A carriage at 0.1 m/s under newtons, 1 kHz, no config: the warning says so, torques are null, 1/mass is found."""
    log, columns = carriage_log(tmp_path / "carriage.csv"), tmp_path / "map.yaml"
    columns.write_text(CARRIAGE_MAP, encoding="utf-8")
    (entry,) = replayed(capsys, str(log), "--columns", str(columns))["logs"]
    assert any("does not look like the default wheel" in text for text in entry["warnings"])
    assert set(entry["physical"].values()) == {None}
    assert entry["state"]["motor_gain"] == pytest.approx(1.0 / 95.0, rel=0.03)
    assert entry["state"]["viscous"] == pytest.approx(214.0 / 95.0, rel=0.1)
    assert entry["rejected"] < 0.01 * entry["samples"]


def test_a_log_without_current_says_that_it_cannot_tell_the_gain(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A coast-down: motor_gain is not identifiable and a warning says why; friction is."""
    (entry,) = replayed(capsys, str(coast_log(tmp_path / "coast.csv")))["logs"]
    assert entry["identifiable"]["motor_gain"] is False
    assert entry["identifiable"]["coulomb"] is True
    assert any("motor gain cannot be learned" in text for text in entry["warnings"])


def test_text_for_people_goes_to_standard_output(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without --json: one block per log with the four parameters, their sigmas and units."""
    assert main(["replay", str(log)]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in (str(log), "motor_gain", "rad/s^2/A", "+-", "NIS"))
    assert "warning" not in text


@pytest.mark.parametrize("speed", [0, 100])
def test_a_sensor_that_is_dead_is_said_to_be_and_tells_no_numbers(
    speed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One and the same number throughout, under a current: no noise is taken from it, and no friction of 1e-9 sigma."""
    log = tmp_path / "dead.csv"
    rows = (f"{i / 10},{speed},{0.2 * math.sin(i / 40)}" for i in range(2000))
    log.write_text("\n".join(["time_s,speed_rpm,current_A", *rows]))
    assert main(["replay", str(log)]) == 0
    said = capsys.readouterr().out
    assert f"the speed is {speed} rpm in every row" in said
    assert "assumed, for the record shows none" in said
    assert said.count("not identifiable") == 4
    main(["fit", str(log)])
    spoken = capsys.readouterr()
    assert "of its friction this log says nothing" in spoken.out + spoken.err or "is its speed constant" in spoken.err
