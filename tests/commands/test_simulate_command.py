"""`rw-ekf simulate`: says where the wheel is and what is true of it, serves a run, refuses what cannot be served."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from rw_ekf.cli import main
from tests.commands.documents import run_document
from tests.contract import check_document
from tests.live.bench import document_of, program, rw_ekf, write_config


@pytest.mark.parametrize(
    "options",
    [
        ("--initial-speed-rpm", "nan"),
        ("--initial-speed-rpm", "inf"),
        ("--speed-factor", "nan"),
        ("--speed-factor", "0"),
        ("--seed", "-1"),
        ("--effect", "no_such_effect:x=1"),
        ("--effect", "quadratic_drag:x=1"),
    ],
)
def test_what_cannot_be_served_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, str]
) -> None:
    """Numbers that are none, unknown effects: status 2, one sentence, and no link is left behind."""
    assert main(["simulate", "--link", str(tmp_path / "wheel"), *options]) == 2
    out, errors = capsys.readouterr()
    assert out == ""
    assert errors.startswith("rw-ekf: error: ")
    assert errors.count("\n") == 1
    assert not (tmp_path / "wheel").is_symlink()


@pytest.mark.parametrize("listing", ["effects", "faults"])
def test_a_listing_is_a_document_where_one_is_asked_for(capsys: pytest.CaptureFixture[str], listing: str) -> None:
    """--json, before the option or behind it, has an entry for each line of the text, in the contract's form."""
    assert main(["simulate", f"--{listing}"]) == 0
    lines = capsys.readouterr().out.splitlines()
    for arguments in ([f"--{listing}", "--json"], ["--json", f"--{listing}"]):
        assert main(["simulate", *arguments]) == 0
        document = json.loads(capsys.readouterr().out)
        check_document(document)
        named = [entry[listing[:-1]] for entry in document[listing]]
        assert len(named) == len(lines)
        assert all(line.startswith(name) for name, line in zip(named, lines, strict=True))


@pytest.mark.parametrize("listing", ["--effects", "--faults"])
def test_a_full_disk_under_a_listing_is_no_traceback(listing: str) -> None:
    """What argparse prints while it parses fails like any other output: status 1, one sentence."""
    with open("/dev/full", "w") as full:
        ended = subprocess.run(
            [sys.executable, "-m", "rw_ekf", "simulate", listing],
            stdout=full,
            stderr=subprocess.PIPE,
            check=False,
            text=True,
        )
    assert ended.returncode == 1
    assert ended.stderr.startswith("rw-ekf: error: standard output")
    assert ended.stderr.count("\n") == 1


@pytest.mark.slow
def test_a_run_of_twenty_seconds_on_a_wheel_ten_times_as_fast_takes_two(tmp_path: Path) -> None:
    """--duration counts seconds of samples; the truth is told with --json; a signal ends the simulator.

    Without --link it is at the configuration's port, where the daemon looks for it.
    """
    link = str(tmp_path / "wheel")
    config = str(write_config(tmp_path, link))
    with program("simulate", "--config", config, "--speed-factor", "10", "--seed", "3", "--json") as simulator:
        assert simulator.stdout is not None
        lines = list(iter(simulator.stdout.readline, "}\n"))
        truth = document_of("".join([*lines, "}"]))
        done = rw_ekf("run", "--config", config, "--duration", "20", "--json")
        simulator.send_signal(signal.SIGTERM)
        assert simulator.wait(5) == 0
    assert truth["truth"]["motor_gain"] == 15.205
    assert done.returncode == 0
    assert run_document(done.stdout)["logs"][0]["duration_s"] == pytest.approx(20.0, abs=1.5)
    assert not Path(link).is_symlink()
