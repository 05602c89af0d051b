"""Row 27: SIGKILL and power cut. The state file is old or new, logs read to the last whole line, nothing is torn."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from rw_ekf.errors import EmptyLogError
from rw_ekf.logs.parts import part_path
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.wheel_log import WheelLog
from tests.live.bench import driven, program, rw_ekf, served_wheel, wait_for
from tests.live.virtual import run
from tools.measure.kills import kill_often


@pytest.mark.slow
def test_two_dozen_kills_at_random_moments_tear_nothing(tmp_path: Path) -> None:
    """Row 27: daemon after daemon in one directory, parts of half a second; `tools.measure.kills` does a thousand."""
    toll = kill_often(tmp_path, 24, seed=3)
    assert toll.torn == []
    assert (toll.kills, toll.ended_before) == (24, 0)
    assert toll.samples > 24
    assert toll.without_rows < 12


def test_after_a_kill_the_next_run_and_stop_find_a_wheel_they_can_take(tmp_path: Path) -> None:
    """Row 27: the killed daemon's claim is no one's, `stop` gives zero, and the next run's log is whole."""
    with served_wheel(tmp_path) as bench:
        config = str(bench.config())
        with program("run", "--config", config) as daemon:
            wait_for(driven(bench))
            wait_for(lambda: len(bench.logs()) == 1 and bench.logs()[0].stat().st_size > 500)
            daemon.kill()
            daemon.wait()
        assert driven(bench)()  # the wheel holds its last current for ever
        assert rw_ekf("stop", "--config", config).returncode == 0
        assert bench.registers.command_A == 0.0
        done = rw_ekf("run", "--config", config, "--duration", "1", timeout=90)
        assert done.returncode == 0, done.stderr
        killed, whole = bench.logs()
        assert len(read_log(killed)) >= 2
        assert len(read_log(whole)) >= 5


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, WheelLog]:
    """The log of a run of ten minutes, as text and as it reads."""
    ran, _ = run(tmp_path_factory.mktemp("written"), 600.0)
    return ran.outcome.files.log.read_bytes(), ran.log


@pytest.mark.parametrize("ending", ["csv", "csv.gz", "csv.zst"])
@pytest.mark.parametrize("tail", [b"", bytes(5000)], ids=["cut", "zeros"])
def test_a_log_reads_to_the_last_whole_line_wherever_the_power_was_cut(
    tmp_path: Path, written: tuple[bytes, WheelLog], ending: str, tail: bytes
) -> None:
    """Row 27: at 40 places, the last part of a run, plain and compressed, the rest missing or blocks of zeros."""
    text, log = written
    first = tmp_path / "run.csv"
    half = text.index(b"\n", len(text) // 2) + 1
    header = text[: text.index(b"\n") + 1]
    first.write_bytes(text[:half])
    whole = read_log(first)
    rest = header + text[half:]
    packed = {"csv": rest, "csv.gz": gzip.compress(rest), "csv.zst": pa.compress(rest, codec="zstd", asbytes=True)}[
        ending
    ]
    rng = np.random.default_rng(4)
    torn = part_path(first, 2).with_name(f"run.part002.{ending}")
    lengths = []
    for cut in sorted(rng.integers(1, len(packed), 40).tolist()):
        torn.write_bytes(packed[:cut] + tail)
        read = read_log(first)
        assert len(read) >= len(whole)
        n = len(read)
        assert np.array_equal(read.time_s, log.time_s[:n])
        # of a line that was cut within its last number the rest stands as it is; every line before is the one written
        assert np.array_equal(read.speed_rad_s[: n - 1], log.speed_rad_s[: n - 1], equal_nan=True)
        lengths.append(n)
    assert lengths == sorted(lengths)
    torn.write_bytes(packed)
    assert np.array_equal(read_log(first).speed_rad_s, log.speed_rad_s, equal_nan=True)


def test_a_part_that_was_only_begun_is_an_empty_log_and_no_harm_to_its_run(
    tmp_path: Path, written: tuple[bytes, WheelLog]
) -> None:
    """Row 27: cut within the header, or before it: alone it is empty, in its run it adds nothing."""
    text, log = written
    first = tmp_path / "run.csv"
    first.write_bytes(text)
    begun = part_path(first, 2)
    for length in (0, text.index(b"\n") + 1):
        begun.write_bytes(text[:length])
        with pytest.raises(EmptyLogError):
            read_log(begun)
        assert len(read_log(first)) == len(log)
