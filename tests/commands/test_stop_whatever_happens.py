"""`rw-ekf stop` with a daemon that hangs, a configuration with mistakes, another user, another name of the port."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from rw_ekf.cli import main
from tests.live.bench import PROGRAM, ROOT, Bench, document_of, driven, program, rw_ekf, served_wheel, wait_for

AS_USER = ("--clear-groups", "--inh-caps=+dac_read_search", "--ambient-caps=+dac_read_search")  # reads our files


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A wheel on a pty."""
    with served_wheel(tmp_path) as made:
        yield made


def as_user(uid: int, *arguments: str) -> tuple[str, ...]:
    """`rw-ekf ARGUMENTS` of another user, as a command."""
    return ("setpriv", f"--reuid={uid}", f"--regid={uid}", *AS_USER, *PROGRAM, *arguments)


other_users = pytest.mark.skipif(
    os.geteuid() != 0
    or shutil.which("setpriv") is None
    or subprocess.run(as_user(65534, "--help"), cwd=ROOT, capture_output=True, check=False).returncode != 0,
    reason="needs root, setpriv and the right to give up all rights but reading",
)


def test_a_daemon_that_hangs_is_killed_and_zero_written(bench: Bench) -> None:
    """Stopped again as soon as it is continued, with the port locked: SIGKILL, then zero; status 0, and it is said."""
    config = str(bench.config())
    with program("run", "--config", config) as daemon:
        wait_for(driven(bench))
        with subprocess.Popen(["sh", "-c", f"while kill -STOP {daemon.pid}; do sleep 0.002; done"], stderr=-3) as again:
            done = rw_ekf("stop", "--config", config, "--json")
            daemon.wait(5)
            again.wait(5)
    assert done.returncode == 0
    document = document_of(done.stdout)
    assert (document["daemon"], document["killed"], document["zero_confirmed"]) == (daemon.pid, True, True)
    assert daemon.returncode == -signal.SIGKILL
    assert bench.registers.command_A == 0.0


MISTAKES = {
    "another key": "wheel: {port: PORT}\nlimits: {current_A: 0.6}\nloop: {rate_hz: fast}\nspam: 1\n",
    "no limits": "wheel: {port: PORT}\n",
    "a repeated section": "wheel: {port: PORT}\nlimits: {current_A: 0.6}\nlimits: {current_A: 0.5}\n",
    "no YAML further down": "wheel:\n  port: PORT\nlimits: {current_A: 0.6}\nfilter: {prior: [\nloop: {rate_hz: 10}\n",
    "a missing model": "wheel: {port: PORT}\nlimits: {current_A: 0.6}\nfilter: {model: nowhere.yaml}\n",
    "no baud rate": "wheel: {port: PORT, baud: quick}\nlimits: {current_A: 0.6}\n",
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_elsewhere_does_not_keep_the_current_on(
    bench: Bench, capsys: pytest.CaptureFixture[str], mistake: str
) -> None:
    """Zero is confirmed with status 0; what is wrong in the file is told with its place."""
    config = bench.directory / "wrong.yaml"
    config.write_text(MISTAKES[mistake].replace("PORT", bench.port))
    bench.registers._command_current(0.3)
    assert main(["stop", "--config", str(config)]) == 0
    out, errors = capsys.readouterr()
    assert out == f"{bench.port}: zero current confirmed\n"
    assert f"{config}:" in errors
    assert "went on" in errors
    assert bench.registers.command_A == 0.0


@pytest.mark.parametrize(
    "text", ["limits: {current_A: 0.6}\n", "wheel: {port: a, port: b}\n", "wheel: {port: 3}\n", "[\n"]
)
def test_without_one_port_there_is_nothing_to_stop(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str
) -> None:
    """No port, two, or no name: status 2, and the sentence says what is needed."""
    config = tmp_path / "wrong.yaml"
    config.write_text(text)
    assert main(["stop", "--config", str(config)]) == 2
    assert "stop needs one port" in capsys.readouterr().err


def test_a_wire_map_that_cannot_be_used_still_ends_the_daemon(bench: Bench) -> None:
    """The daemon is ended, which writes zero; that stop could not write it too is said, with status 2."""
    config = bench.config()
    wrong = bench.directory / "wrong.yaml"
    wrong.write_text(yaml.safe_dump({"wheel": {"port": bench.port, "protocol": "nowhere"}}))
    with program("run", "--config", str(config)) as daemon:
        wait_for(driven(bench))
        done = rw_ekf("stop", "--config", str(wrong))
        daemon.wait(30)
    assert done.returncode == 2
    assert f"daemon {daemon.pid} ended; zero could not be written" in done.stderr
    assert bench.registers.command_A == 0.0


def test_the_port_under_another_name(bench: Bench) -> None:
    """The daemon has the link, stop the device that it leads to: the daemon ends, zero is confirmed."""
    config = str(bench.config())
    other = bench.directory / "other.yaml"
    other.write_text(f"wheel: {{port: {os.path.realpath(bench.port)}}}\n")
    with program("run", "--config", config) as daemon:
        wait_for(driven(bench))
        done = rw_ekf("stop", "--config", str(other))
        daemon.wait(30)
    assert done.returncode == 0
    assert f"daemon {daemon.pid} ended" in done.stdout
    assert bench.registers.command_A == 0.0


@pytest.mark.parametrize("options", [(), ("--supervise",)])
@pytest.mark.parametrize("after_s", [0.05, 0.4, 1.0])
def test_a_stop_reaches_a_run_that_is_still_starting(bench: Bench, options: tuple[str, ...], after_s: float) -> None:
    """Stopped before it can have a claim, while it imports, while it attaches: it ends in order, and writes no more."""
    config = str(bench.config())
    with program("run", "--config", config, *options) as daemon:
        time.sleep(after_s)
        done = rw_ekf("stop", "--config", config)
        written = len(bench.recorder.writes_A())
        daemon.wait(30)
    assert (done.returncode, daemon.returncode) == (0, 0)
    assert not any(bench.recorder.writes_A()[written:])


@other_users
def test_a_daemon_of_another_user_is_ended_by_root(bench: Bench) -> None:
    """Root's stop finds the daemon of nobody, ends it and confirms zero."""
    config = str(opened(bench))
    with foreign_daemon(config) as daemon:
        wait_for(driven(bench))
        done = rw_ekf("stop", "--config", config)
        daemon.wait(30)
    assert done.returncode == 0
    assert f"daemon {daemon.pid} ended" in done.stdout
    assert bench.registers.command_A == 0.0


@other_users
def test_without_the_right_to_signal_zero_is_tried_and_the_daemon_named(bench: Bench) -> None:
    """A third user may open the port but not signal: status 1, process and user named, zero reaches the wheel."""
    config = str(opened(bench))
    with foreign_daemon(config) as daemon:
        wait_for(driven(bench))
        before = bench.recorder.writes_A().count(0.0)
        done = subprocess.run(
            as_user(65533, "stop", "--config", config),
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        assert daemon.poll() is None
    assert done.returncode == 1
    assert f"process {daemon.pid} of user " in done.stderr
    assert "may not signal it" in done.stderr
    assert bench.recorder.writes_A().count(0.0) > before, done.stderr


def opened(bench: Bench) -> Path:
    """The bench's configuration, with its port and directories for every user."""
    config = bench.config()
    os.chmod(os.path.realpath(bench.port), 0o666)
    bench.runs.mkdir(mode=0o777)
    bench.runs.chmod(0o777)
    for place in (bench.directory, *bench.directory.parents):
        if place.stat().st_uid == 0 and str(place).startswith("/tmp/") and place.stat().st_mode & 0o005 == 0:
            place.chmod(0o755)
    return config


def foreign_daemon(config: str) -> subprocess.Popen[str]:
    """A daemon of user nobody; its with block ends when it has."""
    words = as_user(65534, "run", "--config", config)
    return _Killed(words, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, text=True)


class _Killed(subprocess.Popen[str]):
    """Killed at the end of its with block."""

    def __exit__(self, *about: object) -> None:
        self.kill()
        self.wait()


def test_the_document_tells_what_was_wrong(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    """--json: the warnings stand in the document too."""
    config = bench.directory / "wrong.yaml"
    config.write_text(MISTAKES["another key"].replace("PORT", bench.port))
    assert main(["stop", "--config", str(config), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert any("spam" in text for text in document["warnings"])
