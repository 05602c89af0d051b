"""Row 26: disk full, directory removed or read-only. Control goes on, one warning, a counter, what was written reads.

Each ends with the recovery: the place is there again, and so are the run's files.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import json
import math
import os
import resource
import shutil
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.clock import VirtualClock
from rw_ekf.logs.parts import part_path, parts_of
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.writer import EstimateWriter, SampleWriter
from rw_ekf.records import IssuedCommand, WheelSample
from rw_ekf.settings.load import load_configuration
from rw_ekf.sinks.log import LogSink, PartFiles, PartSize
from rw_ekf.sinks.packer import Packer
from rw_ekf.sinks.run_files import Unwritten, state_path
from rw_ekf.wheel.model_file import read_model
from tests.commands.documents import run_document
from tests.live.bench import Bench, driven, program, rw_ekf, served_wheel, wait_for
from tests.live.daemon import Notes, run
from tests.ticks import tick_of

_PR_CAPBSET_DROP, _CAP_DAC_OVERRIDE = 24, 1


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A wheel on a pty."""
    with served_wheel(tmp_path) as made:
        yield made


def remove(directory: Path) -> None:
    """Remove a directory that is being written to."""
    gone = directory.rename(directory.with_name("gone"))  # where nothing new can come while it is emptied
    shutil.rmtree(gone)


def test_a_removed_directory_does_not_end_a_run(bench: Bench) -> None:
    """Row 26: control goes on to the end, one warning, rows and files counted; zero confirmed, an outcome there."""
    ran = run(bench, 2.0, (0.8, lambda: remove(bench.runs)))
    unwritten = ran.outcome.unwritten
    assert ran.notes.events.count("not_written") == 1
    assert ran.outcome.statistics.samples == ran.outcome.timing.ticks >= 20
    assert 0 < unwritten.log_rows < ran.outcome.statistics.samples
    assert sorted(unwritten.other_files) == sorted([ran.outcome.files.model.name, ran.outcome.files.learned.name])
    assert ran.outcome.zero_confirmed
    assert not bench.runs.exists()


def test_the_result_of_a_run_without_its_directory_is_still_printed(bench: Bench) -> None:
    """Row 26: the document comes out on standard output, counts what is missing, and the status is 1."""
    config = str(bench.config())
    with program("run", "--config", config, "--duration", "2", "--json") as daemon:
        wait_for(driven(bench))
        remove(bench.runs)
        out, errors = daemon.communicate(timeout=90)
    document = run_document(out)
    assert daemon.returncode == 1
    assert document["unwritten"]["log_rows"] > 0
    assert document["model"] is None
    assert document["logs"][0]["samples"] == document["loop"]["ticks"]
    assert errors.count("not_written") == 1
    assert "Traceback" not in errors
    assert bench.registers.command_A == 0.0


def test_a_full_disk_leaves_a_log_that_reads(bench: Bench) -> None:
    """Row 26: no file may grow beyond 700 bytes: the run goes on, and the log holds whole rows and replays."""

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (700, 700))

    config = str(bench.config())
    done = rw_ekf("run", "--config", config, "--duration", "1.5", "--json", preexec_fn=limited, timeout=90)
    document = run_document(done.stdout)
    assert done.returncode == 1
    assert document["unwritten"]["log_rows"] > 0
    assert document["unwritten"]["estimate_rows"] > 0
    assert "Traceback" not in done.stderr
    (log,) = bench.logs()
    assert len(read_log(log)) == document["logs"][0]["samples"] - document["unwritten"]["log_rows"]
    assert bench.registers.command_A == 0.0


def writable_to(bench: Bench, pid: int, most_bytes: int) -> None:
    """From now on that process can make no file longer than this; a disk that is full, and one that has been tidied."""
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (most_bytes, resource.RLIM_INFINITY))
    turns = len(bench.recorder.requests)
    wait_for(lambda: len(bench.recorder.requests) > turns + 60)  # some 30 cycles: control goes on


def test_a_disk_without_any_room_and_then_with_room_again(bench: Bench) -> None:
    """Row 26: not a byte more for 30 cycles: one warning, rows counted; then log, estimates, state and model go on."""
    config = bench.config(loop={"rate_hz": 20.0})
    with program("run", "--config", str(config), "--json") as daemon:
        wait_for(driven(bench))
        wait_for(lambda: len(bench.logs()) == 1 and bench.logs()[0].stat().st_size > 500)
        (log,) = bench.logs()
        state = state_path(load_configuration(config))
        writable_to(bench, daemon.pid, 0)
        whole, published = log.stat().st_size, state.read_text(encoding="utf-8")
        assert json.loads(published)["schema"] == "rw_ekf.state/1"
        assert len(read_log(log)) >= 2
        writable_to(bench, daemon.pid, resource.RLIM_INFINITY)
        wait_for(lambda: state.read_text(encoding="utf-8") != published)
        assert log.stat().st_size > whole
        daemon.send_signal(signal.SIGTERM)
        out, errors = daemon.communicate(timeout=90)
    document = run_document(out)
    assert daemon.returncode == 1
    assert errors.count("not_written") == 1
    assert "Traceback" not in errors
    unwritten = document["unwritten"]
    assert unwritten["log_rows"] >= 10
    assert all(name.endswith(".learned.yaml") for name in unwritten["other_files"])  # where its minute fell there
    read = read_log(log)
    assert len(read) == document["logs"][0]["samples"] - unwritten["log_rows"]
    assert len(np.unique(read.segment)) >= 2  # what was in force in between is not known
    assert read_model(Path(document["model"])).parameters.motor_gain == document["logs"][0]["state"]["motor_gain"]
    assert json.loads(state.read_text(encoding="utf-8"))["time_s"] == read.time_s[-1]
    assert bench.registers.command_A == 0.0


def test_a_directory_that_is_removed_and_made_again(bench: Bench) -> None:
    """Row 26: log and estimates go on in a new part, events, state and model are there, every lost row is counted."""
    ran = run(bench, 4.0, (0.8, lambda: remove(bench.runs)), (1.6, bench.runs.mkdir))
    files, unwritten = ran.outcome.files, ran.outcome.unwritten
    assert ran.notes.events.count("not_written") == 1
    assert parts_of(files.log).files == (part_path(files.log, 2),)
    assert parts_of(files.estimates).files == (part_path(files.estimates, 2),)
    assert 10 <= len(ran.log) < ran.outcome.statistics.samples - unwritten.log_rows  # those before are gone
    assert json.loads(files.state.read_text(encoding="utf-8"))["time_s"] == ran.log.time_s[-1]
    assert read_model(files.model).parameters == ran.outcome.belief.parameters
    assert json.loads(files.events.read_text(encoding="utf-8").splitlines()[-1])["event"] == "ended"
    assert unwritten.other_files == []
    assert ran.outcome.zero_confirmed


def test_a_directory_that_is_read_only_for_a_while(bench: Bench) -> None:
    """Row 26: the log goes on without a gap in the part there is, the state file stands; writable again, both go on."""
    config = bench.config(loop={"rate_hz": 20.0}, output={"directory": str(bench.runs), "part_hours": 1.0 / 3600.0})
    with program("run", "--config", str(config), "--json", preexec_fn=_obeying_modes) as daemon:
        wait_for(driven(bench))
        wait_for(lambda: len(bench.logs()) > 0 and bench.logs()[0].stat().st_size > 500)
        state = state_path(load_configuration(config))
        bench.runs.chmod(0o555)
        turns = len(bench.recorder.requests)
        wait_for(lambda: len(bench.recorder.requests) > turns + 20)
        names, published = sorted(os.listdir(bench.runs)), state.read_text(encoding="utf-8")
        turns = len(bench.recorder.requests)
        wait_for(lambda: len(bench.recorder.requests) > turns + 80)
        assert sorted(os.listdir(bench.runs)) == names
        assert state.read_text(encoding="utf-8") == published
        bench.runs.chmod(0o755)
        wait_for(lambda: state.read_text(encoding="utf-8") != published)
        daemon.send_signal(signal.SIGTERM)
        out, errors = daemon.communicate(timeout=90)
    document = run_document(out)
    assert document["unwritten"]["state_files"] > 0
    assert document["unwritten"]["log_rows"] == 0
    assert "Traceback" not in errors
    read = read_log(Path(document["logs"][0]["log"]))
    assert len(read) == document["logs"][0]["samples"]
    assert json.loads(state.read_text(encoding="utf-8"))["time_s"] == read.time_s[-1]
    assert bench.registers.command_A == 0.0


def _obeying_modes() -> None:
    """Take away the right of root to write where a directory's mode says no; of no effect for anybody else."""
    ctypes.CDLL(None).prctl(_PR_CAPBSET_DROP, _CAP_DAC_OVERRIDE)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 1 MB."""
    place = tmp_path / "small"
    place.mkdir()
    made = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "none", place], capture_output=True, check=False)
    if made.returncode != 0:
        pytest.skip("needs the right to mount")
    yield place
    subprocess.run(["umount", "-l", place], check=True)


def test_a_disk_that_fills_up_and_is_tidied(bench: Bench, small_disk: Path) -> None:
    """Row 26: no room until a row was lost, then room again: every row but those counted as lost is in the log."""
    filler = small_disk / "filler"

    def fill() -> None:
        with filler.open("wb", buffering=0) as stream, contextlib.suppress(OSError):
            while True:
                stream.write(bytes(4096))

    def tidy() -> None:
        wait_for(lambda: "not_written" in notes.events)
        filler.unlink()

    rate = {"rate_hz": 20}
    notes = Notes()
    ran = run(bench, 6.0, (0.5, fill), (0.6, tidy), notes=notes, output={"directory": str(small_disk)}, loop=rate)
    unwritten, log = ran.outcome.unwritten, ran.log
    assert unwritten.log_rows + unwritten.estimate_rows > 0
    assert len(log) == ran.outcome.statistics.samples - unwritten.log_rows
    assert log.time_s[-1] - log.time_s[0] > 4.0
    assert ran.notes.events.count("not_written") == 1


class _Full(SampleWriter):
    """Refuses some rows as a full disk does, after part of the line."""

    full = False

    def write_row(self, values: object) -> None:
        """One line, unless it is full."""
        if self.full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        super().write_row(values)  # type: ignore[arg-type]


def test_each_gap_in_a_log_begins_a_segment(tmp_path: Path) -> None:
    """Row 26: rows 2, 3 and 6 of 8 are lost: the segments say where, and the note came once."""
    notes = Notes()
    samples = _Full(tmp_path / "log.csv")
    unwritten = Unwritten()
    unwritten.note("a recorder's file, before")  # says nothing of the log
    part = PartFiles(samples, EstimateWriter(tmp_path / "estimates.csv"))
    size = PartSize(math.inf, math.inf)
    sink = LogSink(lambda number: part, size, Packer(notes.warning), VirtualClock(), unwritten, notes.warning)
    for i in range(8):
        samples.full = i in (2, 3, 6)
        sink.write(tick_of(WheelSample(0.1 * i, 1.0, segment=4), IssuedCommand(0.1)))
    sink.close()
    sink.close()
    assert read_log(tmp_path / "log.csv").segment.tolist() == [0, 0, 1, 1, 2]
    assert (unwritten.log_rows, unwritten.estimate_rows, notes.events) == (3, 0, ["not_written"])


def test_a_planted_link_at_the_state_file_is_not_followed(bench: Bench) -> None:
    """Row 26: the state file's name is known beforehand: a link there is replaced, what it led to stays as it was."""
    victim = bench.directory / "victim"
    victim.write_text("precious")
    bench.runs.mkdir()
    state = state_path(load_configuration(bench.config()))
    state.symlink_to(victim)
    ran = run(bench, 0.6)
    assert victim.read_text() == "precious"
    assert not state.is_symlink()
    assert ran.outcome.unwritten == Unwritten()
