"""Every way out of `rw-ekf run`, as a process: the wheel is left at zero, and the exit status says how it went."""

from __future__ import annotations

import os
import pty
import shlex
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.commands.documents import run_document
from tests.live.bench import PROGRAM, Bench, driven, program, rw_ekf, served_wheel, shell, wait_for


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A wheel on a pty."""
    with served_wheel(tmp_path) as made:
        yield made


def test_the_end_of_the_duration_leaves_the_wheel_at_zero(bench: Bench) -> None:
    """`--duration 1`: exit status 0, the wheel was driven, its command is zero, one document on standard output."""
    done = rw_ekf("run", "--config", str(bench.config()), "--duration", "1", "--json")
    assert done.returncode == 0
    document = run_document(done.stdout)
    assert document["logs"][0]["samples"] == pytest.approx(11, abs=1)
    assert any(abs(value) > 0.01 for value in bench.recorder.writes_A())
    assert bench.registers.command_A == 0.0


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT"])
def test_a_signal_ends_the_run_in_order(bench: Bench, name: str) -> None:
    """The signal, and a second one behind it: exit status 0, the wheel at zero, the whole document printed."""
    with program("run", "--config", str(bench.config()), "--json") as daemon:
        wait_for(driven(bench))
        daemon.send_signal(getattr(signal, name))
        wait_for(lambda: bench.registers.command_A == 0.0)
        daemon.send_signal(getattr(signal, name))
        out, errors = daemon.communicate(timeout=60.0)
    assert daemon.returncode == 0, errors
    assert run_document(out)["stopped_by"] == name
    assert "Traceback" not in errors
    assert bench.registers.command_A == 0.0


def test_a_terminal_that_hangs_up_leaves_the_wheel_at_zero(bench: Bench) -> None:
    """The daemon's own terminal vanishes with all three streams on it: SIGHUP, exit status 0, zero, a model written."""
    master, terminal = pty.openpty()
    arguments = ("run", "--config", str(bench.config()))
    with program(*arguments, stdin=terminal, stdout=terminal, stderr=terminal, start_new_session=True) as daemon:
        wait_for(driven(bench))
        turns = len(bench.recorder.requests)
        wait_for(lambda: len(bench.recorder.requests) > turns + 80)  # some four seconds: something is learned
        os.close(terminal)
        os.close(master)
        daemon.send_signal(signal.SIGHUP)
        assert daemon.wait(20) == 0
    assert bench.registers.command_A == 0.0
    assert list(bench.runs.glob("*.model.yaml"))


@pytest.mark.slow
def test_losing_standard_error_does_not_end_the_run(bench: Bench) -> None:
    """Whoever read the log lines goes away: the run lasts its duration and reports as ever."""
    with program("run", "--config", str(bench.config()), "--duration", "2", "--json") as daemon:
        wait_for(driven(bench))
        assert daemon.stderr is not None
        daemon.stderr.close()
        daemon.stderr = None
        bench.unplug()  # something to complain about
        bench.plug()
        out, _ = daemon.communicate(timeout=60.0)
    assert daemon.returncode == 0
    assert run_document(out)["link"]["reconnects"] == 1
    assert bench.registers.command_A == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("closed", ["2>&-", ">&- 2>&-"])
def test_a_run_started_without_its_streams_works(bench: Bench, closed: str) -> None:
    """Started with standard error, or both outputs, closed: exit status 0 and a log as always."""
    command = f"exec {shlex.join(PROGRAM)} run --config {bench.config()} --duration 0.5 {closed}"
    with shell(command) as daemon:
        daemon.communicate(timeout=60.0)
    assert daemon.returncode == 0
    assert len(bench.logs()) == 1
    assert bench.registers.command_A == 0.0


@pytest.mark.slow
def test_a_reader_that_goes_away_does_not_fail_the_run(bench: Bench) -> None:
    """Standard output closed by its reader before the report: exit status 0, no traceback, the files are there."""
    with program("run", "--config", str(bench.config()), "--duration", "1", "--json") as daemon:
        wait_for(driven(bench))
        assert daemon.stdout is not None
        daemon.stdout.close()
        daemon.stdout = None
        _, errors = daemon.communicate(timeout=60.0)
    assert daemon.returncode == 0
    assert "Traceback" not in errors
    assert "report_lost" in errors
    assert list(bench.runs.glob("*.model.yaml"))


def test_stop_from_outside_ends_the_daemon_and_confirms_zero(bench: Bench) -> None:
    """`rw-ekf stop` while a run goes on: the run ends with status 0, stop names it and confirms zero, status 0."""
    config = str(bench.config())
    with program("run", "--config", config, "--json") as daemon:
        wait_for(driven(bench))
        done = rw_ekf("stop", "--config", config)
        out, _ = daemon.communicate(timeout=60.0)
    assert (done.returncode, daemon.returncode) == (0, 0)
    assert f"daemon {daemon.pid} ended" in done.stdout
    assert "zero current confirmed" in done.stdout
    assert run_document(out)["stopped_by"] == "SIGTERM"
    assert bench.registers.command_A == 0.0


@pytest.mark.slow
def test_stop_finds_a_daemon_that_was_started_in_another_environment(bench: Bench) -> None:
    """XDG_RUNTIME_DIR and TMPDIR differ between the two shells: stop still finds the run."""
    config = str(bench.config())
    elsewhere = os.environ | {"XDG_RUNTIME_DIR": str(bench.directory), "TMPDIR": str(bench.directory)}
    with program("run", "--config", config, env=elsewhere) as daemon:
        wait_for(driven(bench))
        done = rw_ekf("stop", "--config", config)
        daemon.communicate(timeout=60.0)
    assert (done.returncode, daemon.returncode) == (0, 0)
    assert f"daemon {daemon.pid} ended" in done.stdout


def test_a_second_daemon_on_one_port_is_refused(bench: Bench) -> None:
    """The second run exits 1 with one sentence that names the first, which goes on unharmed."""
    config = str(bench.config())
    with program("run", "--config", config) as daemon:
        wait_for(driven(bench))
        second = rw_ekf("run", "--config", config, "--duration", "1")
        assert daemon.poll() is None
        daemon.send_signal(signal.SIGTERM)
        daemon.communicate(timeout=60.0)
    assert (second.returncode, daemon.returncode) == (1, 0)
    assert second.stdout == ""
    assert second.stderr.count("\n") == 1
    assert f"process {daemon.pid}" in second.stderr


@pytest.mark.slow
def test_a_link_lost_to_the_end_exits_1_with_the_document(bench: Bench) -> None:
    """Unplugged in mid-run and never back: status 1, the whole document with a warning, no traceback."""
    with program("run", "--config", str(bench.config()), "--duration", "1.5", "--json") as daemon:
        wait_for(driven(bench))
        bench.unplug()
        out, errors = daemon.communicate(timeout=60.0)
    assert daemon.returncode == 1
    assert any("lost to the end" in text for text in run_document(out)["logs"][0]["warnings"])
    assert "Traceback" not in errors
    assert "rw-ekf stop" in errors
