"""A run as MCAP: complete after a kill, indexed after an end, and read back as the log it stands beside."""

from __future__ import annotations

import errno
import json
import os
import re
import time
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rw_ekf as library
from rw_ekf.cli import main
from rw_ekf.logs.reader import read_log
from rw_ekf.settings.resources import config_directory
from tests.live.bench import CURRENT_COMMAND, CYCLE, program, served_wheel, wait_for
from tests.live.virtual import run
from tests.recorders.ticks import recorder, turn

pytest.importorskip("mcap")
pytest.importorskip("zstandard")

SAMPLE, ESTIMATE, EVENT = "/wheel/sample", "/wheel/estimate", "/wheel/event"


def messages(path: Path) -> dict[str, list[dict[str, Any]]]:
    """Every message by topic, as MCAP's own reader of streams gives it, also of a file that was cut off."""
    from mcap.exceptions import EndOfFile
    from mcap.reader import NonSeekingReader

    found: dict[str, list[dict[str, Any]]] = {SAMPLE: [], ESTIMATE: [], EVENT: []}
    with path.open("rb") as stream:
        try:
            for _, channel, message in NonSeekingReader(stream, validate_crcs=True).iter_messages(log_time_order=False):
                found[channel.topic].append(json.loads(message.data))
        except EndOfFile:
            pass
    return found


@pytest.mark.slow
def test_after_a_kill_every_tick_but_the_last_can_be_read(tmp_path: Path) -> None:
    """The wheel itself counts the currents it was sent, one a tick; the daemon is killed, twice. Line protocol too."""
    for directory in (tmp_path / "a", tmp_path / "b"):
        directory.mkdir()
        with served_wheel(directory) as bench:
            config = bench.config(output={"mcap": True, "influx": "file"})

            def sent() -> int:
                return sum(frame.id == CURRENT_COMMAND for _, frame in list(bench.recorder.requests))

            with program("run", "--config", str(config)) as daemon:
                wait_for(lambda: sent() > 40, within_s=60.0)
                time.sleep(0.03)
                daemon.kill()
                daemon.wait()
            (path,) = bench.runs.glob("*.mcap")
            found = messages(path)
            ticks = sent() - 1  # the first was zero, before the loop
            wanted = sum(frame.id == CYCLE for _, frame in bench.recorder.requests)
            assert ticks - 1 <= len(found[SAMPLE])  # a tick without a reply commands nothing
            assert sum(row["speed_rad_s"] is not None for row in found[SAMPLE]) <= wanted
            assert len(found[ESTIMATE]) == len(found[SAMPLE])
            assert [row["time_s"] for row in found[SAMPLE]] == [row["time_s"] for row in found[ESTIMATE]]
            assert found[EVENT][-1]["event"]["state"] == "TRACKING"
            log = read_log(path)
            assert len(log) == len(found[SAMPLE])
            assert any("cut off" in warning for warning in log.warnings)
            (lines,) = bench.runs.glob("*.lp")
            assert ticks - 1 <= len(read_log(lines)) <= len(log)
            known = read_log(bench.logs()[0])  # the CSV may be two ticks behind
            assert len(log) >= len(known)
            assert np.array_equal(log.speed_rad_s[: len(known)], known.speed_rad_s, equal_nan=True)


def test_what_is_read_back_is_the_log_and_gives_its_estimates(tmp_path: Path) -> None:
    """Every column equal to the last bit, a silence and a new segment included; so is every estimate of a replay."""
    from tests.live.virtual import setting

    happenings = ((20.0, setting(silent=True)), (24.0, setting(silent=False)))
    ran, _ = run(tmp_path, 60.0, *happenings, output={"mcap": True}, limits={"silence_s": 1.5, "safe_after_s": None})
    path = ran.outcome.files.log.with_suffix(".mcap")
    ours, log = read_log(path), ran.log
    for name in ("time_s", "speed_rad_s", "current_A", "command_delay_s", "segment"):
        assert np.array_equal(getattr(ours, name), getattr(log, name), equal_nan=True), name
    assert len(log) > 100
    assert len(set(log.segment.tolist())) > 1
    assert library.replay(ours).table.equals(library.replay(log).table)


def test_columns_writes_the_map_that_the_log_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The guess of columns is that for the CSV, without a question."""
    ran, _ = run(tmp_path, 40.0, output={"mcap": True})
    maps = []
    for path in (ran.outcome.files.log, ran.outcome.files.log.with_suffix(".mcap")):
        assert main(["columns", str(path)]) == 0
        maps.append([line for line in capsys.readouterr().out.splitlines() if not line.startswith("# Columns of")])
    assert maps[0] == maps[1]
    assert any(line.startswith("speed_rad_s: {column: speed_rad_s") for line in maps[1])


def test_a_file_that_ended_has_chunks_index_and_what_the_run_was(tmp_path: Path) -> None:
    """A seeking reader finds the summary, compressed chunks, and the metadata and first model of the run."""
    from mcap.reader import make_reader

    ran, _ = run(tmp_path, 40.0, output={"mcap": True})
    with ran.outcome.files.log.with_suffix(".mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert {chunk.compression for chunk in summary.chunk_indexes} == {"zstd"}
        assert summary.statistics.message_count == 2 * len(ran.log) + 3  # connecting, tracking, ended
        attached = {attachment.name: attachment.data for attachment in reader.iter_attachments()}
        (about,) = reader.iter_metadata()
    files = ran.outcome.files
    assert attached == {path.name: path.read_bytes() for path in (files.log.with_suffix(".meta.yaml"), files.start)}
    assert (about.metadata["wheel"], about.metadata["log"]) == ("wheel", files.log.name)


def test_a_disk_without_room_tears_nothing_and_what_comes_after_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three ticks find half the room they need: they are gone, all others are whole, in a segment of their own."""
    sink, _ = recorder(tmp_path, "mcap", True)
    write, full = os.write, [False]

    def half(descriptor: int, data: bytes) -> int:
        if not full[0]:
            return write(descriptor, data)
        if len(data) > 100:
            return write(descriptor, data[:100])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("rw_ekf.plain_file.os.write", half)
    refused = 0
    for i in range(20):
        full[0] = 5 <= i < 8
        try:
            sink.write(turn(i))
        except OSError:
            refused += 1
    sink.close()
    assert refused == 3
    found = messages(tmp_path / "run.mcap")
    assert [round(10 * (row["time_s"] - 100.0)) for row in found[SAMPLE]] == [*range(5), *range(8, 20)]
    assert [row["segment"] for row in found[SAMPLE]] == [0] * 5 + [3] * 12


def test_it_goes_on_in_parts_and_where_its_file_was_removed(tmp_path: Path) -> None:
    """Parts of 20 kB and a removal in between: every tick that was not removed is in one part, each with its index."""
    from mcap.reader import SeekingReader

    sink, _ = recorder(tmp_path, "mcap", True, part_megabytes=0.02)
    for i in range(200):
        if i == 195:
            removed = max(tmp_path.glob("run.part*.mcap"))
            assert not removed.read_bytes().endswith(b"\x89MCAP0\r\n")
            gone = [row["time_s"] for row in messages(removed)[SAMPLE]]
            removed.unlink()
        sink.write(turn(i))
    sink.close()
    parts = sorted(tmp_path.glob("*.mcap"), key=lambda path: (path.name != "run.mcap", path.name))
    assert len(parts) > 3
    assert all(SeekingReader(BytesIO(path.read_bytes())).get_summary() for path in parts)
    times = [row["time_s"] for path in parts for row in messages(path)[SAMPLE]]
    assert sorted([*times, *gone]) == [turn(i).sample.time_s for i in range(200)]
    assert times == sorted(times)


def test_a_run_without_a_sample_leaves_none(tmp_path: Path) -> None:
    """As the log, which is not left behind either."""
    sink, _ = recorder(tmp_path, "mcap", True)
    sink.close()
    assert list(tmp_path.iterdir()) == []


def test_the_layout_names_what_the_file_has(tmp_path: Path) -> None:
    """Every path of config/foxglove-layout.json is a topic and a field of its messages, and every panel is placed."""
    layout = json.loads((config_directory() / "foxglove-layout.json").read_text())
    sink, _ = recorder(tmp_path, "mcap", True)
    for i in range(3):
        sink.write(turn(i))
    sink.close()
    found = messages(tmp_path / "run.mcap")
    paths = [path["value"] for panel in layout["configById"].values() for path in panel.get("paths", [])]
    assert len(paths) > 10
    for path in paths:
        topic, _, field = path.rpartition(".")
        assert found[topic][-1][field] is not None, path
    assert {p["topicToRender"] for p in layout["configById"].values() if "topicToRender" in p} <= found.keys()
    assert set(re.findall(r"\w+!\w+", json.dumps(layout["layout"]))) == set(layout["configById"])
