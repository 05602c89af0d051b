"""What lies where a file should: pipes, devices, JSON without end; each is one sentence, and none is waited for."""

from __future__ import annotations

import itertools
import json
import os
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from rw_ekf.clock import VirtualClock
from rw_ekf.errors import BadInputError, LogError
from rw_ekf.live.published_state import read_published
from rw_ekf.logs.reader import read_log
from rw_ekf.plain_file import append_line, json_of, read_plain
from rw_ekf.records import RunState, StateNow
from rw_ekf.settings.load import load_configuration
from rw_ekf.sinks.events import EventsSink
from rw_ekf.sinks.run_files import state_path
from rw_ekf.spikes.run_events import _event
from tests.live.bench import rw_ekf, write_config

BEGAN = StateNow(RunState.CONNECTING, "2026-11-25T10:00:00Z", "begun")


def pipe(path: Path) -> Path:
    """A pipe in the place of a file."""
    os.mkfifo(path)
    return path


@pytest.mark.parametrize("verb", ["check-config", "status", "stop", "run", "columns", "model"])
def test_a_pipe_or_a_device_in_the_place_of_a_document_is_one_sentence(tmp_path: Path, verb: str) -> None:
    """Nobody writes to the pipe and /dev/zero has no end: exit status 2 and a line that names it, without waiting."""
    log = tmp_path / "log.csv"
    log.write_text("time_s,speed_rpm,current_A\n0,1,0\n1,1,0\n", encoding="utf-8")
    for place in (str(pipe(tmp_path / "pipe")), "/dev/zero"):
        wanted = {
            "check-config": ("check-config", place),
            "columns": ("replay", str(log), "--columns", place),
            "model": ("replay", str(log), "--model", place),
        }.get(verb, (verb, "--config", place))
        done = rw_ekf(*wanted)
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
        assert place in done.stderr
        assert "no plain file" in done.stderr


def test_a_state_file_that_is_a_pipe_or_has_no_end_is_none(tmp_path: Path) -> None:
    """`status` with a pipe, /dev/zero or a directory where the state file lies: not alive, at once."""
    config = write_config(tmp_path, str(tmp_path / "nothing"))
    place = state_path(load_configuration(config))
    place.parent.mkdir(parents=True)
    for put in (os.mkfifo, lambda path: path.symlink_to("/dev/zero"), Path.mkdir):
        put(place)
        assert rw_ekf("status", "--config", str(config), "--json").returncode == 4
        place.rmdir() if place.is_dir() else place.unlink()


def state_document() -> dict[str, Any]:
    """What a run publishes, in short."""
    state = dict.fromkeys(("speed_rad_s", "motor_gain", "viscous", "coulomb", "static"), 1.0)
    return {
        "schema": "rw_ekf.state/1", "pid": os.getpid(), "start_ticks": 1, "ended_utc": None, "run_state": "TRACKING",
        "utc": "2026-11-25T10:00:00", "since_utc": "2026-11-25T10:00:00Z", "reason": "well", "log": "a.csv",
        "link": {"state": "answered", "requests": 5}, "state": state, "std": state, "current_command_A": 0.1,
        "alarms": [],
    }  # fmt: skip


@pytest.mark.parametrize("value", [None, 3, "text", [], [1], {}, {"a": 1}, 1.0e300, True])
def test_no_state_file_ends_in_a_traceback(tmp_path: Path, capsys: pytest.CaptureFixture[str], value: Any) -> None:
    """Each key in turn is something else, and the time has no zone: `status` says something of it, exit status 4."""
    from rw_ekf.cli import main

    config = write_config(tmp_path, str(tmp_path / "nothing"))
    place = state_path(load_configuration(config))
    place.parent.mkdir(parents=True)
    whole = state_document()
    changed = [whole, *({**whole, key: value} for key in whole)]
    changed += [{**whole, outer: {**whole[outer], key: value}} for outer in ("link", "state") for key in whole[outer]]
    changed += [{**whole, "alarms": [value]}, {**whole, "compensation": value}]
    for document, json_too in itertools.product(changed, ([], ["--json"])):
        place.write_text(json.dumps(document), encoding="utf-8")
        assert main(["status", "--config", str(config), *json_too]) == 4
    assert "Traceback" not in capsys.readouterr().err


def test_a_whole_state_file_is_taken(tmp_path: Path) -> None:
    """The document that the test above changes is one that is read."""
    place = tmp_path / "state.json"
    place.write_text(json.dumps(state_document()), encoding="utf-8")
    found = read_published(place)
    assert found is not None
    assert (found.run_state, found.alive) == ("TRACKING", False)


def test_a_run_does_not_wait_for_the_reader_of_a_pipe(tmp_path: Path) -> None:
    """A pipe, a device, a link under the name of the events: the run is refused before its first turn."""
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    for place in (pipe(tmp_path / "pipe"), tmp_path / "link", Path("/dev/null"), tmp_path):
        with pytest.raises(BadInputError, match=r"cannot be made .*: give another output\.directory"):
            EventsSink(place, VirtualClock(), BEGAN)
    with pytest.raises(OSError, match="no plain file"):
        append_line(Path("/dev/null"), b"x")


def test_json_without_end_is_none() -> None:
    """A hundred thousand brackets, bytes that are no text, half a document: no document; and an event is left out."""
    for text in ("[" * 100_000, b"\xff\xfe\xff", '{"a": ', b""):
        assert json_of(text) is None
    assert json_of('{"a": [1]}') == {"a": [1]}
    assert _event(b"[" * 100_000) is None


def test_only_so_much_is_read(tmp_path: Path) -> None:
    """A long file ends where the caller says."""
    place = tmp_path / "long"
    place.write_bytes(b"x" * 1000)
    assert len(read_plain(place, 100)) == 100


@pytest.mark.parametrize("packing", ["zstd", "gzip"])
def test_what_unpacks_to_next_to_nothing_is_refused(tmp_path: Path, packing: str) -> None:
    """40 kB that hold as much as a disk are no log; a hundred thousand rows that are nearly the same are one."""
    bomb = tmp_path / "bomb.csv"
    for line, why in ((b"1,1,1\n", "more than 4000 times its size"), (b"000000", "no line ends|more than 4000 times")):
        with pa.output_stream(str(bomb), compression=packing) as stream:
            for _ in range(40):
                stream.write(line * 1_000_000)
        if packing == "zstd" or line == b"000000":
            with pytest.raises(LogError, match=why):
                read_log(bomb)
    rows = "".join(f"{0.1 * i:.1f},100,0.1\n" for i in range(100_000))
    log = tmp_path / "log.csv"
    with pa.output_stream(str(log), compression=packing) as stream:
        stream.write(b"time_s,speed_rpm,current_A\n" + rows.encode())
    assert len(read_log(log)) == 100_000
