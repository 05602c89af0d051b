"""A run's directory replays to the very estimates of its runs: over parts, restarts, faults and silences."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.cli import main
from rw_ekf.filter.belief import Belief
from rw_ekf.log_replay import replay_log, setup_of_run
from rw_ekf.logs.metadata import metadata_path
from rw_ekf.logs.parts import parts_of
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.run_directory import runs_of, start_path
from tests.commands.documents import replay_document
from tests.live.daemon import Ran
from tests.live.virtual import run, setting

CLOSE = 1.0e-9  # standard deviations


def apart(one: Belief, two: Belief) -> float:
    """Largest difference in sigmas, of means and of sigmas themselves."""
    return max(float(np.max(np.abs(one.mean - two.mean) / two.std)), float(np.max(np.abs(one.std - two.std) / two.std)))


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Ran]:
    """Three runs in one directory, in parts: faults and silences; another start; a line that stays lost."""
    directory = tmp_path_factory.mktemp("runs")
    output = {"directory": str(directory / "runs"), "part_hours": 1.5 / 60.0}
    faults = [
        (100.0, setting(silent=True)), (100.6, setting(silent=False)),  # a reply or two
        (200.0, setting(silent=True)), (203.0, setting(silent=False)),  # beyond silence_s
        (300.0, setting(unplugged=True)), (330.0, setting(unplugged=False)),
    ]  # fmt: skip
    prior = {"motor_gain": {"value": 14.0, "std": 2.0}, "coulomb": {"value": 0.5, "std": 0.1}}
    first, _ = run(directory, 500.0, *faults, output=output)
    second, _ = run(directory, 200.0, output=output, filter={"prior": prior, "speed_noise_rpm": 1.5})
    third, _ = run(directory, 300.0, (250.0, setting(unplugged=True)), output=output)
    return [first, second, third]


@pytest.mark.parametrize("online", [False, True])
def test_every_run_of_a_directory_replays_to_its_own_estimates(runs: list[Ran], online: bool) -> None:
    """Oldest first, parts joined, each from its own start: the last belief of each to 1e-9 sigma, both ways."""
    logs, others = runs_of(runs[0].outcome.files.log.parent)
    assert logs == [ran.outcome.files.log for ran in runs]
    assert others == []
    for ran, log in zip(runs, logs, strict=True):
        assert len(parts_of(log).files) > 2
        done = replay_log(read_log(log), setup=setup_of_run(log), online=online)
        assert done.statistics.samples == ran.outcome.statistics.samples
        assert done.statistics.reseeded == ran.outcome.statistics.reseeded
        assert apart(done.belief, ran.outcome.belief) < CLOSE


def document(capsys: pytest.CaptureFixture[str], *args: str) -> dict[str, Any]:
    """What a command prints."""
    assert main([*args, "--json"]) == 0
    return replay_document(capsys.readouterr().out)


def test_the_command_takes_a_directory_and_a_run_by_name(runs: list[Ran], capsys: pytest.CaptureFixture[str]) -> None:
    """`replay DIR` and `replay --as-run STEM.csv` say what the runs said; with --config all start from that one."""
    files = runs[1].outcome.files
    entries = document(capsys, "replay", str(files.log.parent))["logs"]
    assert [entry["log"] for entry in entries] == [str(ran.outcome.files.log) for ran in runs]
    for entry, ran in zip(entries, runs, strict=True):
        belief = ran.outcome.belief
        assert np.allclose(list(entry["state"].values()), belief.mean[:5], rtol=0.0, atol=CLOSE * belief.std[:5])
    (alone,) = document(capsys, "replay", "--as-run", str(files.log))["logs"]
    assert alone == entries[1]
    (record,) = document(capsys, "replay", str(files.log))["logs"]
    assert record["state"] != alone["state"]  # without a word on its start the record itself tells of the noises
    configuration = str(files.log.parent.parent / "wheel.yaml")  # that of the last run
    others = document(capsys, "replay", str(files.log.parent), "--config", configuration)["logs"]
    assert others[2] == entries[2]
    assert others[1]["state"] != entries[1]["state"]


def test_two_runs_from_one_belief_replay_as_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`replay DIR`, for a person: runs that began from the same belief, and no word of noise taken from a record."""
    for _ in range(2):
        run(tmp_path, 20.0, filter={"continue_learned": False})
    assert main(["replay", str(tmp_path / "runs")]) == 0
    out = capsys.readouterr().out
    assert out.count("41 samples") == 2
    assert "taken from" not in out


def test_a_run_replays_from_the_model_it_started_from(runs: list[Ran], tmp_path: Path) -> None:
    """Where a STEM.start.yaml stands beside the log it is the start, and filter.prior does not count a second time."""
    first, second = runs[0].outcome, runs[1].outcome
    ran, _ = run(tmp_path, 100.0, filter={"model": str(first.files.model)})
    log = ran.outcome.files.log
    assert apart(replay_log(ran.log, setup=setup_of_run(log)).belief, ran.outcome.belief) < CLOSE
    start_path(log).write_text(second.files.model.read_text(encoding="utf-8"), encoding="utf-8")
    start = setup_of_run(log).prior
    assert np.array_equal(start.mean[1:], second.belief.mean[1:])
    assert np.array_equal(start.covariance[1:, 1:], second.belief.covariance[1:, 1:])


def test_what_is_no_run_is_left_out_with_a_word(
    runs: list[Ran], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A stranger's table, a run killed before its first row; a directory without a log is refused."""
    log = runs[2].outcome.files.log
    rows = "time_s,speed_rad_s,current_A\n"
    assert main(["replay", str(tmp_path)]) == 2
    assert "holds no log" in capsys.readouterr().err
    (tmp_path / "a.csv").write_text(rows + "0,1,0\n1,1,0\n", encoding="utf-8")
    (tmp_path / "b.csv").write_text(rows, encoding="utf-8")
    metadata_path(tmp_path / "b.csv").write_bytes(metadata_path(log).read_bytes())
    for part in parts_of(log).files:
        (tmp_path / part.name).write_bytes(part.read_bytes())
    metadata_path(tmp_path / log.name).write_bytes(metadata_path(log).read_bytes())
    assert main(["replay", str(tmp_path), "--json"]) == 0
    stated = capsys.readouterr()
    assert [Path(entry["log"]).name for entry in json.loads(stated.out)["logs"]] == [log.name]
    assert stated.err.count("left_out") == 2
    assert main(["replay", str(tmp_path / "a.csv"), "--as-run"]) == 2
    assert main(["replay", str(log), "--as-run", "--model", "x.yaml"]) == 2
