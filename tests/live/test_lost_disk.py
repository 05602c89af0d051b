"""The output directory is removed, or its disk full, while a wheel is driven: the run goes on, and says so."""

from __future__ import annotations

import contextlib
import errno
import math
import os
import resource
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from rw_ekf.clock import VirtualClock
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.writer import EstimateWriter, SampleWriter
from rw_ekf.records import IssuedCommand, WheelSample
from rw_ekf.settings.load import load_configuration
from rw_ekf.sinks.log import LogSink, PartFiles, PartSize
from rw_ekf.sinks.packer import Packer
from rw_ekf.sinks.run_files import Unwritten, state_path
from tests.commands.documents import run_document
from tests.live.bench import Bench, driven, program, rw_ekf, served_wheel, wait_for
from tests.live.daemon import Notes, run
from tests.ticks import tick_of


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
    """Control goes on to the end, one warning, rows and files counted; zero confirmed, an outcome there."""
    ran = run(bench, 2.0, (0.8, lambda: remove(bench.runs)))
    unwritten = ran.outcome.unwritten
    assert ran.notes.events.count("not_written") == 1
    assert ran.outcome.statistics.samples == ran.outcome.timing.ticks >= 20
    assert 0 < unwritten.log_rows < ran.outcome.statistics.samples
    assert sorted(unwritten.other_files) == sorted([ran.outcome.files.model.name, ran.outcome.files.learned.name])
    assert ran.outcome.zero_confirmed
    assert not bench.runs.exists()


def test_the_result_of_a_run_without_its_directory_is_still_printed(bench: Bench) -> None:
    """The document comes out on standard output, counts what is missing, and the status is 1."""
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
    """No file may grow beyond 700 bytes: the run goes on, and the log holds whole rows and replays."""

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
    """No room until the first row was lost, then room again: every row but those counted as lost is in the log."""
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
    """Rows 2, 3 and 6 of 8 are lost: the segments say where, and the note came once."""
    notes = Notes()
    samples = _Full(tmp_path / "log.csv")
    unwritten = Unwritten()
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
    """The state file's name is known beforehand: a link there is replaced, what it led to stays as it was."""
    victim = bench.directory / "victim"
    victim.write_text("precious")
    bench.runs.mkdir()
    state = state_path(load_configuration(bench.config()))
    state.symlink_to(victim)
    ran = run(bench, 0.6)
    assert victim.read_text() == "precious"
    assert not state.is_symlink()
    assert ran.outcome.unwritten == Unwritten()
