"""`rw-ekf run`, `excite` and `stop`: documents, log lines, and every port that is no wheel."""

from __future__ import annotations

import json
import os
import pty
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from rw_ekf.cli import main
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.wheel.model_file import WheelModel
from tests.commands.documents import run_document
from tests.live.bench import ROOT, Bench, document_of, rw_ekf, served_wheel, write_config


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A wheel on a pty."""
    with served_wheel(tmp_path) as made:
        yield made


def refused(capsys: pytest.CaptureFixture[str], *arguments: str, status: int) -> str:
    """What a command says that could not work: one sentence, nothing on standard output."""
    assert main(arguments) == status
    out, errors = capsys.readouterr()
    assert out == ""
    assert "Traceback" not in errors
    assert errors.startswith("rw-ekf: error: ")
    assert errors.count("\n") == 1
    return errors


def test_json_log_lines_are_json_and_the_document_stands_alone(bench: Bench) -> None:
    """run --json --log-format json: one document on standard output, every line of standard error an object."""
    done = rw_ekf("run", "--config", str(bench.config()), "--duration", "0.6", "--json", "--log-format", "json")
    assert done.returncode == 0
    document = run_document(done.stdout)
    assert document["loop"]["ticks"] == document["logs"][0]["samples"] >= 3  # 7 on a machine that has time
    assert document["link"]["requests"] >= 2 * document["loop"]["ticks"]
    lines = [json.loads(line) for line in done.stderr.splitlines()]
    assert {"attached", "ended"} <= {line["event"] for line in lines}
    assert all({"level", "timestamp", "wheel"} <= set(line) for line in lines)


def test_excite_drives_the_named_profile(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    """excite S2 ignores the configuration's profile, begins at the bias of -50 mA, and reports like a run."""
    assert main(["excite", "S2", "--config", str(bench.config()), "--duration", "0.8", "--json"]) == 0
    run_document(capsys.readouterr().out)
    driven = [value for value in bench.recorder.writes_A() if value != 0.0]
    assert all(-0.06 < value < -0.03 for value in driven)
    assert bench.registers.command_A == 0.0


@pytest.mark.parametrize("verb", [["run"], ["excite", "S2"]])
def test_a_model_on_the_command_line_is_where_a_run_starts(
    bench: Bench, capsys: pytest.CaptureFixture[str], verb: list[str]
) -> None:
    """--model is read from where one stands and goes before filter.model; its motor gain, known well, is the run's."""
    named, configured = bench.directory / "named.yaml", bench.directory / "configured.yaml"
    for path, gain in ((named, 14.0), (configured, 17.0)):
        parameters = CK13_STATISTICAL._replace(motor_gain=gain)
        covariance = tuple(tuple(1e-8 if i == j else 0.0 for j in range(4)) for i in range(4))
        model = WheelModel(parameters, covariance, 0.42, "gauss", 0.1, None, 1.5e-3)
        path.write_text(model.to_text(), encoding="utf-8")
    config = bench.config(filter={"model": str(configured)})
    arguments = [*verb, "--config", str(config), "--duration", "0.6", "--json"]
    for extra, gain in (([], 17.0), (["--model", str(named)], 14.0)):
        assert main([*arguments, *extra]) == 0
        document = run_document(capsys.readouterr().out)
        assert document["logs"][0]["state"]["motor_gain"] == pytest.approx(gain, abs=0.01)


def test_a_run_in_words_says_each_thing_once(bench: Bench) -> None:
    """Zero confirmed in the last log line, the result on standard output, its model's path as it can be typed."""
    done = rw_ekf("run", "--config", str(bench.config(limits={"silence_s": 2.0})), "--duration", "2")
    assert done.returncode == 0
    assert "zero_current=confirmed" in done.stderr.splitlines()[-1]
    assert "finding" not in done.stderr
    model = next(line for line in done.stdout.splitlines() if line.startswith("  model: ")).split()[1]
    assert (ROOT / model).is_file()
    assert done.stdout.count(".csv") == 1


def test_stop_without_a_daemon_writes_zero_itself(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    """A wheel left under current by someone else: zero confirmed, no daemon named, one document with --json."""
    bench.registers._command_current(0.3)
    assert main(["stop", "--config", str(bench.config()), "--json"]) == 0
    document = document_of(capsys.readouterr().out)
    about = {"schema": "rw_ekf.stop/1", "port": bench.port, "zero_confirmed": True, "daemon": None}
    assert document == about | {"killed": False, "warnings": []}
    assert bench.registers.command_A == 0.0


def test_stop_reaches_a_wheel_whose_answers_are_lost(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing comes back: zero goes out all the same and acts; the status is 1, because nobody confirmed it."""
    bench.registers._command_current(0.3)
    bench.fault("silence")
    assert "no wheel confirmed it" in refused(capsys, "stop", "--config", str(bench.config()), status=1)
    assert bench.registers.command_A == 0.0


@pytest.mark.parametrize("verb", ["run", "stop"])
def test_a_port_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str) -> None:
    """Exit status 1, the port named, what to do."""
    config = write_config(tmp_path, str(tmp_path / "nowhere"))
    message = refused(capsys, verb, "--config", str(config), status=1)
    assert str(tmp_path / "nowhere") in message
    assert "simulate" in message


def test_a_port_that_is_busy(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    """Another program has the port for itself: run and stop say so, and it is not disturbed."""
    import serial

    with serial.Serial(bench.port, exclusive=True):
        for verb in ("run", "stop"):
            assert "in use" in refused(capsys, verb, "--config", str(bench.config()), status=1)
    assert bench.recorder.requests == []


@pytest.mark.parametrize("babbles", [False, True])
def test_a_port_where_no_wheel_speaks(tmp_path: Path, capsys: pytest.CaptureFixture[str], babbles: bool) -> None:
    """Silence, or garbage without end: after two seconds one sentence with baud rate and bytes counted, status 1."""
    import tty

    master, device = pty.openpty()
    tty.setraw(device)
    over = threading.Event()

    def babble() -> None:
        while not over.wait(0.01):
            os.write(master, b"\x00\x1f\x7f garbage \xff")

    thread = threading.Thread(target=babble if babbles else over.wait, daemon=True)
    thread.start()
    try:
        config = write_config(tmp_path, os.ttyname(device))
        message = refused(capsys, "run", "--config", str(config), status=1)
    finally:
        over.set()
        thread.join(5.0)
        os.close(device)
        os.close(master)
    assert "no valid frame in 2.0 s" in message
    assert "38400" in message
    assert not (tmp_path / "runs").exists()
