"""What a run leaves: a log by the contract, metadata, a model; and a replay of it says the same as the run."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml

from rw_ekf.cli import main
from rw_ekf.filter.belief import Belief
from rw_ekf.log_replay import replay_log
from rw_ekf.logs.log_columns import LOG_COLUMNS
from rw_ekf.logs.metadata import read_metadata
from rw_ekf.logs.reader import read_log
from rw_ekf.settings.load import load_configuration
from rw_ekf.sinks.run_files import RunFiles
from rw_ekf.wheel.model_file import read_model
from tests.commands.documents import replay_document
from tests.contract import check_document
from tests.live.bench import Bench, driven, program, rw_ekf, served_wheel, wait_for, write_config
from tests.live.daemon import Ran, run
from tests.live.test_line_faults import fault
from tests.live.virtual import run as virtual_run


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A wheel on a pty."""
    with served_wheel(tmp_path) as made:
        yield made


@pytest.fixture(scope="module")
def quiet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Bench, Ran]]:
    """A run of three seconds on a healthy line."""
    with served_wheel(tmp_path_factory.mktemp("quiet")) as bench:
        yield bench, run(bench, 3.0)


def test_the_log_is_by_the_contract(quiet: tuple[Bench, Ran]) -> None:
    """Columns, growing time on the wheel's clock, a delay near 10 ms, the command that the wheel then reports."""
    _, ran = quiet
    header = ran.outcome.files.log.read_text(encoding="utf-8").splitlines()[0]
    assert tuple(header.split(",")) == LOG_COLUMNS
    log = ran.log
    assert len(log) == ran.outcome.statistics.samples
    assert 15 <= len(log) <= 31  # a busy machine skips ticks
    assert log.time_s[0] > 100.0
    assert float(np.median(np.diff(log.time_s))) == pytest.approx(0.1, abs=0.03)
    assert 0.008 < float(np.median(log.command_delay_s)) < 0.1  # the line alone takes 8 ms
    reported = log.channels["current_A"]
    differences = np.abs(reported[1:] - log.current_A[:-1])
    assert np.nanmax(differences) < 1e-9
    assert np.count_nonzero(np.isnan(differences)) <= 2  # a reply that a busy machine gave too late
    assert not [text for text in log.warnings if "no current_command_A" not in text]  # of those late replies


def test_metadata_stand_beside_the_log(quiet: tuple[Bench, Ran]) -> None:
    """UTC of the first sample, the wheel's identity, the whole configuration, version and source of the data."""
    bench, ran = quiet
    found = read_metadata(ran.outcome.files.log)
    assert found is not None
    assert found.first_sample_utc.endswith("Z")
    assert found.source == f"serial+{bench.port}"
    assert found.identity is not None
    assert (found.identity.kind, found.identity.serial_number) == (6, 1)
    assert found.configuration["limits"]["current_A"] == 0.6
    assert found.version


def test_the_state_file_holds_the_last_estimate(quiet: tuple[Bench, Ran]) -> None:
    """At the end of the run the published state is that of the last sample, not one of a second ago."""
    _, ran = quiet
    document = json.loads(ran.outcome.files.state.read_text(encoding="utf-8"))
    check_document(document)
    assert document["time_s"] == ran.log.time_s[-1]
    assert list(document["state"].values()) == list(ran.outcome.belief.mean)


def same(one: Belief, two: Belief) -> float:
    """Largest difference in sigmas, of means and of sigmas themselves."""
    return max(float(np.max(np.abs(one.mean - two.mean) / two.std)), float(np.max(np.abs(one.std - two.std) / two.std)))


@pytest.mark.parametrize("online", [False, True])
def test_a_replay_says_what_the_run_said(quiet: tuple[Bench, Ran], online: bool) -> None:
    """Replay of the log with the run's configuration: the same estimates to a millionth of a sigma, both ways."""
    bench, ran = quiet
    done = replay_log(ran.log, load_configuration(bench.directory / "wheel.yaml"), online=online)
    assert same(done.belief, ran.outcome.belief) < 1e-6
    assert done.statistics.samples == ran.outcome.statistics.samples
    assert done.statistics.missing == ran.outcome.statistics.missing
    assert done.statistics.rejected == ran.outcome.statistics.rejected
    assert done.statistics.duration_s == pytest.approx(ran.outcome.statistics.duration_s)
    for key, value in done.statistics.innovation_document().items():
        assert value == pytest.approx(ran.outcome.statistics.innovation_document()[key], rel=1e-6)


@pytest.mark.slow
def test_a_replay_of_a_run_full_of_faults_says_the_same(bench: Bench) -> None:
    """Missing ticks, a silence with its zero, a restart, lost confirmations: the replay still agrees with the run."""
    fast = {"profile": "steps", "amplitude_A": 0.2, "period_s": 0.8, "bias_A": 0.05}
    ran = run(
        bench,
        4.0,
        *fault(bench, 0.4, 0.62, "silence"),
        *fault(bench, 0.9, 1.6, "silence"),
        (2.0, bench.registers.restart),
        *fault(bench, 2.5, 2.9, "silence/current_command"),
        *fault(bench, 3.2, 3.7, "flip/from:1/2"),
        command=fast,
    )
    assert ran.outcome.statistics.missing > 0
    for online in (False, True):
        done = replay_log(ran.log, load_configuration(bench.directory / "wheel.yaml"), online=online)
        assert done.statistics.samples == ran.outcome.statistics.samples
        assert done.statistics.missing == ran.outcome.statistics.missing
        assert done.statistics.reseeded == ran.outcome.statistics.reseeded
        assert same(done.belief, ran.outcome.belief) < 1e-6


def test_the_model_of_a_run_starts_a_replay_and_the_next_run(quiet: tuple[Bench, Ran], tmp_path: Path) -> None:
    """`.model.yaml` reads, goes into `replay --model` and into `filter.model`, and carries the run's parameters."""
    bench, ran = quiet
    files = ran.outcome.files
    model = read_model(files.model)
    assert model.parameters == ran.outcome.belief.parameters
    assert np.array_equal(np.array(model.covariance), ran.outcome.belief.covariance[1:, 1:])
    done = rw_ekf("replay", str(files.log), "--model", str(files.model), "--json")
    assert done.returncode == 0
    replay_document(done.stdout)
    next_run = run(bench, 0.5, filter={"model": str(files.model)})
    assert next_run.outcome.setup.prior.parameters == model.parameters


def test_two_runs_in_one_second_do_not_share_a_file(bench: Bench) -> None:
    """Names of files are new for every run, also within the same second."""
    first, second = run(bench, 0.2), run(bench, 0.2)
    assert first.outcome.files.log != second.outcome.files.log
    assert len(bench.logs()) == 2


def test_a_wheel_s_name_may_be_anything(tmp_path: Path) -> None:
    """Slashes, dots and three hundred letters in wheel.name make a harmless file name."""
    from datetime import UTC, datetime

    for name in ("../../etc/passwd", "x" * 300, "Rad Nr. 1 / süd"):
        path = write_config(tmp_path, "/dev/nowhere", wheel={"name": name}, output={"directory": str(tmp_path)})
        files = RunFiles.of_run(load_configuration(path), datetime.now(UTC))
        assert files.log.parent == tmp_path
        files.log.write_text("", encoding="utf-8")


def test_a_link_that_is_turned_in_mid_run_does_not_tear_the_run_apart(tmp_path: Path) -> None:
    """output.directory is a link, turned after 100 s: every file of the run is where the link led at its start."""
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
    link = tmp_path / "out"
    link.symlink_to("one")

    def turn(*_: object) -> None:
        link.unlink()
        link.symlink_to("two")

    output = {"directory": str(link), "part_hours": 1.0 / 60.0}
    ran, _ = virtual_run(tmp_path, 240.0, (100.0, turn), output=output)
    assert len(ran.log) == ran.outcome.statistics.samples
    assert ran.log.warnings == ()
    assert ran.outcome.files.log.parent == tmp_path / "one"
    stem = ran.outcome.files.log.stem
    assert not list((tmp_path / "two").glob(f"{stem}*"))
    assert (tmp_path / "one" / f"{stem}.model.yaml").exists()


def test_a_run_without_a_sample_leaves_what_happened_and_no_more(tmp_path: Path) -> None:
    """The line is gone before the first reading: no log without a row, no model that is the prior."""
    gone = (0.0, lambda wheel, stop: setattr(wheel, "unplugged", True))
    ran, _ = virtual_run(tmp_path, 5.0, gone)
    assert ran.outcome.statistics.samples == 0
    assert ran.outcome.model is None
    left = [path.name for path in (tmp_path / "runs").iterdir() if path.name.startswith(ran.outcome.files.log.stem)]
    assert left == [ran.outcome.files.events.name]


def test_output_that_cannot_be_made_is_bad_input(bench: Bench) -> None:
    """output.directory below a file: exit status 2, one sentence, and the wheel was never driven."""
    (bench.directory / "file").write_text("", encoding="utf-8")
    config = bench.config(output={"directory": str(bench.directory / "file" / "runs")})
    done = rw_ekf("run", "--config", str(config), "--duration", "1")
    assert done.returncode == 2
    assert "output.directory" in done.stderr
    assert "Traceback" not in done.stderr
    assert all(value == 0.0 for value in bench.recorder.writes_A())


@pytest.mark.slow
def test_after_a_kill_the_files_are_whole(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    """SIGKILL in mid-run, thrice: log and estimates parse, the state is valid JSON, a replay works, stop gives zero."""
    config = str(bench.config())
    for kills, after_s in enumerate((0.25, 0.6, 1.13), 1):
        with program("run", "--config", config) as daemon:  # the dead daemon's claim does not stand in the way
            wait_for(driven(bench))
            seen = len(bench.recorder.requests)
            wait_for(lambda seen=seen, after_s=after_s: len(bench.recorder.requests) > seen + 20 * after_s)  # type: ignore[misc]
            wait_for(lambda: len(bench.logs()[-1].read_text(encoding="utf-8").splitlines()) > 3)  # a busy machine
            daemon.kill()
            daemon.wait()
        assert len(bench.logs()) == kills
        log = bench.logs()[-1]
        assert len(read_log(log)) >= 2
        rows = log.with_suffix(".estimates.csv").read_text(encoding="utf-8").splitlines()
        assert len({row.count(",") for row in rows}) == 1
        state = json.loads(next(bench.runs.glob("*.state.json")).read_text(encoding="utf-8"))
        assert state["log"] == log.name
        assert len(state["state"]) == 5
        assert yaml.safe_load(log.with_suffix(".meta.yaml").read_text(encoding="utf-8"))["first_sample_utc"]
        assert main(["replay", str(log), "--config", config, "--json"]) == 0
        replay_document(capsys.readouterr().out)
        assert rw_ekf("stop", "--config", config).returncode == 0
        assert bench.registers.command_A == 0.0
    again = rw_ekf("run", "--config", config, "--duration", "0.3")
    assert again.returncode == 0
