"""The last hour of a run in memory: what it holds, and that the end of a run is judged by it and by no file."""

from __future__ import annotations

import builtins
import os
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.commands.run_report import warnings_of
from rw_ekf.course.course import Course
from rw_ekf.records import IssuedCommand, WheelSample
from rw_ekf.sinks.recent import RecentSink
from tests.live.virtual import run, setting
from tests.ticks import tick_of


def test_the_ring_holds_the_newest_rows_in_their_order() -> None:
    """Of 36 rows kept 90 are given: the last 36, oldest first; commands that are not known hold what was before."""
    sink = RecentSink(rate_hz=0.01)
    for i in range(90):
        command = None if i % 2 else IssuedCommand(0.01 * i, 0.001 * i)
        sink.write(tick_of(WheelSample(float(i), None if i == 80 else 2.0 * i, segment=i // 60), command))
        assert sink.is_whole == (i < 36)
    sink.close()
    course = sink.course()
    assert course.time_s.tolist() == list(range(54, 90))
    assert course.segment.tolist() == [i // 60 for i in range(54, 90)]
    assert np.flatnonzero(np.isnan(course.speed_rad_s)).tolist() == [26]
    assert course.duration_s == (59 - 54) + (89 - 60)
    assert {round(100.0 * value) for value in course.pieces.current_A} <= set(range(54, 90, 2))


def test_a_short_run_is_judged_by_the_very_log_that_it_wrote(tmp_path: Path) -> None:
    """A silence and a lost line in it: times, speeds, segments and pieces of current are those of the log read back."""
    events = (
        (50.0, setting(silent=True)), (53.0, setting(silent=False)),
        (80.0, setting(unplugged=True)), (95.0, setting(unplugged=False)),
    )  # fmt: skip
    ran, _ = run(tmp_path, 150.0, *events)
    assert ran.outcome.recent.is_whole
    kept, written = ran.outcome.recent.course(), Course.of_log(ran.log)
    for mine, theirs in zip((*kept[:4], *kept.pieces), (*written[:4], *written.pieces), strict=True):
        assert np.array_equal(mine, theirs, equal_nan=True)


def test_the_end_of_a_long_run_says_which_stretch_was_judged_and_opens_no_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two hours at 1 Hz on a wheel whose readings are five times as noisy as configured: the last hour is named."""
    ran, _ = run(tmp_path, 7200.0, loop={"rate_hz": 1.0}, filter={"speed_noise_rpm": 0.2})
    opened: list[str] = []
    for module, name in ((builtins, "open"), (os, "open")):
        true = getattr(module, name)

        def watched(path: object, *args: object, true=true, **options: object) -> object:  # type: ignore[no-untyped-def]
            opened.append(str(path))
            return true(path, *args, **options)

        monkeypatch.setattr(module, name, watched)
    stated = warnings_of(ran.outcome)
    assert any("(Judged over the last 60 min of the run.)" in text for text in stated), stated
    assert not [path for path in opened if "runs" in path]
