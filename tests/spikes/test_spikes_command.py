"""`rw-ekf spikes`: what a directory of runs says of drag spikes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.cli import main
from rw_ekf.spikes.run_events import RunEvents, Spike, read_run
from rw_ekf.spikes.trending import spikes_of_runs, verdict
from tests.contract import check_document
from tests.spikes.runs import write_run


def document_of(directory: Path, capsys: pytest.CaptureFixture[str], *options: str) -> dict[str, Any]:
    """The document, checked against the contract."""
    assert main(["spikes", str(directory), *options, "--json"]) == 0
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    check_document(document)
    return document


def test_a_month_of_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Three runs of one wheel: every spike with date, time in its run, speed, size, share, decay; a rate."""
    write_run(tmp_path, 0.0, 100.0, [10.0, 10.5, 50.0])
    write_run(tmp_path, 10.0, 100.0, [20.0])
    write_run(tmp_path, 20.0, 200.0, [190.0], ended=False)
    document = document_of(tmp_path, capsys)
    (wheel,) = document["wheels"]
    assert (wheel["runs"], wheel["watched_h"], wheel["trains"]) == (3, pytest.approx(400.0), 4)
    assert [spike["train"] for spike in wheel["spikes"]] == [1, 1, 2, 3, 4]
    assert [spike["watched_h"] for spike in wheel["spikes"]] == pytest.approx([10, 10.5, 50, 120, 390], abs=0.01)
    first = wheel["spikes"][0]
    assert first["utc"] == "2026-01-01T10:00:00Z"
    assert [spike["since_start_s"] for spike in wheel["spikes"]] == [36000.0, 37800.0, 180000.0, 72000.0, 684000.0]
    assert first["speed_rpm"] == pytest.approx(271.2, abs=0.1)
    assert first["percent_of_coulomb"] == pytest.approx(100 * 0.5 / 1.5 / 0.6)
    assert (first["amplitude_mNm"], first["decay_s"], first["end"]) == (0.5, 400.0, "faded")
    assert wheel["trains_per_100_h"]["value"] == pytest.approx(1.0)
    assert wheel["trend"]["verdict"] == "no_trend"
    assert any("cut off" in text for text in document["warnings"])
    assert main(["spikes", str(tmp_path)]) == 0
    out, errors = capsys.readouterr()
    assert "2026-01-01T10:00:00Z         36000     1" in out
    assert "1.00 trains per 100 h" in out
    assert "cut off" in errors


def test_a_train_is_as_long_as_it_is_said_to_be(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Half an hour apart: one train by default, two where ten minutes end a train."""
    write_run(tmp_path, 0.0, 100.0, [10.0, 10.5])
    assert document_of(tmp_path, capsys)["wheels"][0]["trains"] == 1
    assert document_of(tmp_path, capsys, "--train", "600")["wheels"][0]["trains"] == 2


def test_two_wheels_are_two_and_unwatched_runs_are_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By serial number; a run whose watch was off counts for nothing, and is named."""
    write_run(tmp_path, 0.0, 50.0, [1.0], serial=7)
    write_run(tmp_path, 5.0, 60.0, [], serial=8)
    off = write_run(tmp_path, 10.0, 70.0, [], watched=False)
    document = document_of(tmp_path, capsys)
    assert [(w["wheel"], w["watched_h"]) for w in document["wheels"]] == [
        ("wheel (serial number 7)", pytest.approx(50.0)), ("wheel (serial number 8)", pytest.approx(60.0)),
    ]  # fmt: skip
    assert [text for text in document["warnings"] if off.name in text]
    assert document["wheels"][1]["trend"] is None
    assert document["wheels"][1]["trains_per_100_h"]["low"] == 0.0


def test_what_the_watch_took_back_is_no_spike(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An event gone within a minute is counted apart; one that the run's end cut short is a spike."""
    write_run(tmp_path, 0.0, 50.0, [1.0, 9.0], end="gone within a minute: shorter than a drag spike")
    write_run(tmp_path, 5.0, 50.0, [49.9], end=None)
    (wheel,) = document_of(tmp_path, capsys)["wheels"]
    assert (len(wheel["spikes"]), wheel["taken_back"]) == (1, 2)
    assert (wheel["spikes"][0]["end"], wheel["spikes"][0]["decay_s"]) == (None, None)


def test_only_the_time_that_was_tracked_is_watched(tmp_path: Path) -> None:
    """Two hours without a line in a run of ten: eight are watched, and a spike behind them is that much earlier."""
    log = write_run(tmp_path, 0.0, 10.0, [9.0])
    path = log.with_name(log.name.replace(".csv", ".events.jsonl"))
    lines = path.read_text().splitlines()
    lost = {"utc": "2026-01-01T03:00:00Z", "time_s": 10800.0, "event": "state", "state": "LOST"}
    back = {"utc": "2026-01-01T05:00:00Z", "time_s": 18000.0, "event": "state", "state": "TRACKING"}
    lines[2:2] = [json.dumps(lost), json.dumps(back), '{"utc": "2026-01']
    path.write_text("\n".join(lines) + "\n")
    run = read_run(log)
    assert run is not None
    assert run.watched_s == pytest.approx(8 * 3600.0)
    assert run.spikes[0].watched_s == pytest.approx(7 * 3600.0)
    (warning,) = run.warnings
    assert ":5: is no event" in warning


@pytest.mark.parametrize("jump_s", [3600.0, -5000.0, -1.0e6])
@pytest.mark.parametrize("ended", [True, False])
def test_a_clock_of_the_wheel_that_jumps_changes_nothing_of_the_time_watched(
    jump_s: float, ended: bool, tmp_path: Path
) -> None:
    """The run's own clock counts: an hour forward was an hour watched, and behind a restart all before it was lost."""
    log = write_run(tmp_path, 0.0, 10.0, [9.0], ended=ended)
    path = log.with_name(log.name.replace(".csv", ".events.jsonl"))
    events = [json.loads(line) for line in path.read_text().splitlines()]
    for event in events:
        event["run_s"] = event["time_s"] or 0.0
        for key in {"time_s", "since_s"} & event.keys() if event["run_s"] > 3600.0 else ():
            event[key] += jump_s
    path.write_text("".join(json.dumps(event) + "\n" for event in events))
    rows = log.read_text().splitlines()
    log.write_text("\n".join([*rows[:-1], f"{36000.0 + jump_s},100.0,0.1"]) + "\n")
    run = read_run(log)
    assert run is not None
    assert run.watched_s == pytest.approx(36000.0 if ended or jump_s > -36000.0 else 32402.0, abs=0.01)
    assert run.spikes[0].watched_s == pytest.approx(9 * 3600.0)


def runs_with(times_h: list[float], sizes: list[float], hours: float) -> list[RunEvents]:
    """Ten runs of equal length with spikes at these hours of all that was watched."""
    each = hours / 10
    runs = [RunEvents("wheel", Path(f"{n}.csv"), watched_s=3600.0 * each) for n in range(10)]
    for time, size in zip(times_h, sizes, strict=True):
        number = min(int(time / each), 9)
        within_s = 3600.0 * (time - number * each)
        runs[number].spikes.append(Spike("", "", within_s, 100.0, size, 0.05, 20.0, 400.0, "faded"))
    return runs


def test_months_of_homogeneous_spikes_are_called_a_trend_at_the_level_alone() -> None:
    """500 wheels, 20 spikes each on average over 2000 h, some in trains: 5 % have a trend, in sizes too."""
    rng = np.random.default_rng(3)
    trends = sizes = 0
    for _ in range(500):
        begins = rng.uniform(0.0, 2000.0, rng.poisson(20))
        trains = [begin + 0.2 * n for begin in begins for n in range(rng.integers(1, 4))]
        times = sorted(time for time in trains if time < 2000.0)
        found = spikes_of_runs("wheel", runs_with(times, rng.lognormal(0.0, 0.7, len(times)).tolist(), 2000.0), 3600.0)
        assert found.trend is not None
        assert found.size_trend is not None
        trends += verdict(found.trend) != "no_trend"
        sizes += found.size_trend.p_value < 0.05
    assert trends / 500 < 0.05 + 3.0 * np.sqrt(0.05 * 0.95 / 500)
    assert sizes / 500 < 0.05 + 3.0 * np.sqrt(0.05 * 0.95 / 500)


def test_a_rising_incidence_and_growing_sizes_are_seen() -> None:
    """Six times as many at the end as at the beginning, each 3 % larger than the one before: both are said."""
    rng = np.random.default_rng(4)
    times = sorted(2000.0 * np.sqrt(rng.uniform(size=50)))
    found = spikes_of_runs("wheel", runs_with(times, [0.2 * 1.03**n for n in range(50)], 2000.0), 0.0)
    assert found.trend is not None
    assert verdict(found.trend) == "rising"
    assert found.size_trend is not None
    assert found.size_trend.tau > 0.9


def test_a_picture_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """--out writes a PNG, also where a wheel has no spike at all."""
    write_run(tmp_path / "runs", 0.0, 50.0, [1.0, 9.0, 30.0], serial=7)
    write_run(tmp_path / "runs", 5.0, 60.0, [], serial=8)
    path = tmp_path / "spikes.png"
    assert main(["spikes", str(tmp_path / "runs"), "--out", str(path)]) == 0
    capsys.readouterr()
    assert path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["empty", "gone"])
def test_a_directory_without_runs_is_refused(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No run, no directory: status 2 and a sentence, which asks for a directory and not for files."""
    (tmp_path / "empty").mkdir()
    assert main(["spikes", str(tmp_path / name)]) == 2
    out, errors = capsys.readouterr()
    assert out == ""
    assert name in errors
    assert "files themselves" not in errors
    assert name == "gone" or "name one that runs were written into (`output.directory`)" in errors
