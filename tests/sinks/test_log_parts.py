"""The log of a run goes on in parts: by time, by size, after a removal; closed ones are compressed beside the loop."""

from __future__ import annotations

import shutil
from dataclasses import fields
from pathlib import Path

import numpy as np

from rw_ekf.clock import VirtualClock
from rw_ekf.logs.parts import parts_of
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.records import IssuedCommand, LinkCounters, RunState, Sink, StateNow, WheelSample
from rw_ekf.settings.schema import OutputSection
from rw_ekf.sinks.all_sinks import SINKS, RunContext
from rw_ekf.sinks.run_files import RunFiles
from tests.live.daemon import Notes
from tests.live.virtual import run, setting
from tests.ticks import STATE, tick_of


def context(directory: Path, **output: float) -> RunContext:
    """What the log's sink needs of a run."""
    names = [field.name for field in fields(RunFiles)]
    kept = {name: directory / f"run.{name}" for name in names} | {"log": directory / "run.csv"}
    return RunContext(
        files=RunFiles(**kept | {"estimates": directory / "run.estimates.csv"}),
        wheel="wheel",
        port="/dev/nowhere",
        output=OutputSection.model_validate(output),
        state_names=STATE._fields,
        clock=VirtualClock(),
        logger=Notes(),
        began=StateNow(RunState.CONNECTING, "2000-01-01T00:00:00Z", "the line has been opened"),
        link=LinkCounters,
        process={},
    )


def log_sink(made: RunContext) -> Sink:
    """As a run makes it."""
    parts = SINKS["log"].make(made)
    assert parts is not None
    return parts[0]


def feed(made: RunContext, rows: range, meanwhile: dict[int, object] | None = None) -> WheelLog:
    """Write rows ten a second through the log's sink, calling what shall happen before some of them; the log."""
    sink = log_sink(made)
    for i in rows:
        if meanwhile and i in meanwhile:
            meanwhile[i]()  # type: ignore[operator]
        sink.write(tick_of(WheelSample(0.1 * i, 1.0 / (i + 1), segment=i // 400), IssuedCommand(0.001 * i)))
    sink.close()
    return read_log(made.files.log)


def names(made: RunContext) -> list[str]:
    """Files of the run, in order."""
    return sorted(path.name for path in made.files.log.parent.iterdir())


def test_a_log_is_rotated_by_time_and_its_closed_parts_are_compressed(tmp_path: Path) -> None:
    """100 s in parts of 30 s, time beginning anew meanwhile: four parts, all but the last compressed, no row lost."""
    made = context(tmp_path, part_hours=30.0 / 3600.0)
    log = feed(made, range(1000))
    assert np.array_equal(log.time_s, 0.1 * np.arange(1000))
    assert log.segment.tolist() == [i // 400 for i in range(1000)]
    assert names(made) == [
        "run.csv.zst", "run.estimates.csv.zst", "run.part002.csv.zst", "run.part002.estimates.csv.zst",
        "run.part003.csv.zst", "run.part003.estimates.csv.zst", "run.part004.csv", "run.part004.estimates.csv",
            "run.sums",
    ]  # fmt: skip
    assert not made.unwritten
    assert made.logger.events == []


def test_a_log_is_rotated_by_size(tmp_path: Path) -> None:
    """No part's files are longer than asked for but by a line, and none is nearly empty."""
    made = context(tmp_path, part_megabytes=0.005)
    log = feed(made, range(1000))
    assert len(log) == 1000
    assert len(parts_of(made.files.log).files) > 5


def test_a_part_that_cannot_be_begun_is_said_once_and_the_log_goes_on(tmp_path: Path) -> None:
    """A stranger's file has the name of the next part: it stays, and every row is in the first."""
    (tmp_path / "run.part002.csv").write_text("precious")
    made = context(tmp_path, part_hours=10.0 / 3600.0)
    sink = log_sink(made)
    for i in range(3000):
        sink.write(tick_of(WheelSample(0.1 * i, 1.0), IssuedCommand(0.1)))
    sink.close()
    assert (tmp_path / "run.part002.csv").read_text() == "precious"
    assert made.logger.events == ["part_not_begun"]
    assert len(made.files.log.read_text().splitlines()) == 3001
    assert not made.unwritten


def test_a_directory_that_comes_back_gets_the_log_again_in_a_new_part(tmp_path: Path) -> None:
    """Removed at row 100, there again at row 200: the rows since are in part 2, those between are counted."""
    runs = tmp_path / "runs"
    runs.mkdir()
    made = context(runs)
    log = feed(made, range(300), {100: lambda: shutil.rmtree(runs), 200: runs.mkdir})
    assert names(made) == ["run.part002.csv", "run.part002.estimates.csv", "run.sums"]
    assert np.array_equal(log.time_s, 0.1 * np.arange(200, 300))
    assert made.unwritten.log_rows == 100
    assert made.logger.events == ["not_written"]
    assert "part 1 of the run is not there" in log.warnings[-1]


def test_a_log_that_another_program_cuts_goes_on_in_a_new_part(tmp_path: Path) -> None:
    """copytruncate at row 150: what was there is counted and said, what comes reads, nothing begins with zeros."""
    made = context(tmp_path)
    log = feed(made, range(300), {150: lambda: made.files.log.write_bytes(b"")})
    assert made.unwritten.log_rows == 151  # with the row that found it
    assert made.logger.events == ["not_written"]
    assert np.array_equal(log.time_s, 0.1 * np.arange(151, 300))
    assert any("run.csv" in text and "missing" in text for text in log.warnings)
    assert b"\0" not in b"".join(path.read_bytes() for path in tmp_path.glob("*.csv"))


def test_a_run_in_parts_leaves_the_log_of_a_run_in_one(tmp_path: Path) -> None:
    """The daemon, twice over the same wheel with a silence in it: the same rows, whether rotated or not."""
    blink = (200.0, setting(silent=True)), (203.0, setting(silent=False))
    logs = []
    for name, hours in (("one", 24.0), ("many", 1.0 / 60.0)):
        (tmp_path / name).mkdir()
        ran, _ = run(tmp_path / name, 400.0, *blink, output={"directory": str(tmp_path / name), "part_hours": hours})
        logs.append(ran.log)
    one, many = logs
    assert len(list((tmp_path / "many").glob("*.part*.csv*"))) == 2 * 6
    assert np.array_equal(one.time_s, many.time_s)
    assert np.array_equal(one.speed_rad_s, many.speed_rad_s, equal_nan=True)
    assert np.array_equal(one.current_A, many.current_A)
    assert np.array_equal(one.segment, many.segment)
    assert np.array_equal(one.command_delay_s, many.command_delay_s)
