"""What is written reads back as it was, bit for bit."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rw_ekf.errors import BadInputError
from rw_ekf.logs.atomic import atomic_path
from rw_ekf.logs.log_columns import LOG_COLUMNS
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.tables import write_table
from rw_ekf.logs.wheel_log import Drive, WheelLog

FINITE = st.floats(allow_nan=False, allow_infinity=False)
MAYBE = FINITE | st.just(float("nan"))


@st.composite
def logs(draw: st.DrawFn) -> WheelLog:
    n = draw(st.integers(1, 12))

    def array(values: st.SearchStrategy[float]) -> np.ndarray:
        return np.array(draw(st.lists(values, min_size=n, max_size=n)))

    jumps = np.array(draw(st.lists(st.booleans(), min_size=n, max_size=n)))
    jumps[0] = False
    segment = np.cumsum(jumps).astype(np.int64)
    steps = st.floats(1e-6, 1e6)
    drive: Drive = draw(st.sampled_from(["current_command_A", "current_A"]))
    current_A = array(FINITE)
    channels: dict[str, np.ndarray] = {drive: current_A}
    for name in ("temperature_degC", "status", "angle_rad"):
        if draw(st.booleans()):
            channels[name] = array(MAYBE)
    return WheelLog(
        name="made",
        time_s=np.cumsum(array(steps)),
        speed_rad_s=array(MAYBE),
        current_A=current_A,
        drive=drive,
        command_delay_s=array(st.floats(0, 10)),
        segment=segment,
        channels=channels,
    )


def same_bits(one: np.ndarray, two: np.ndarray) -> bool:
    """Equal in every bit, but for the payload of NaN."""
    gaps = np.isnan(one)
    return bool(np.array_equal(gaps, np.isnan(two)) and one[~gaps].tobytes() == two[~gaps].tobytes())


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".mat"])
def test_export_then_read_is_the_same_log(tmp_path: Path, suffix: str) -> None:
    """Proves that no float, segment, delay or channel changes on the way out and in."""

    @settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(log=logs())
    def check(log: WheelLog) -> None:
        path = tmp_path / f"log{suffix}"
        log.save(path)
        again = read_log(path)
        for name in ("time_s", "speed_rad_s", "current_A", "command_delay_s"):
            assert same_bits(getattr(log, name), getattr(again, name)), name
        assert np.array_equal(log.segment, again.segment)
        assert again.drive == log.drive
        assert set(again.channels) == set(log.channels)
        assert all(same_bits(log.channels[name], again.channels[name]) for name in log.channels)
        assert again.skipped_rows == 0

    check()


def test_gaps_in_the_driving_current_survive(tmp_path: Path) -> None:
    """Proves that the raw column is exported, not the held one."""
    (tmp_path / "a.csv").write_text("time_s,speed_rad_s,current_command_A,extra\n0,1,2,x\n1,1,,y\n2,1,3,\n")
    log = read_log(tmp_path / "a.csv")
    log.save(tmp_path / "b.csv")
    again = read_log(tmp_path / "b.csv")
    assert np.isnan(again.channels["current_command_A"][1])
    assert again.current_A.tolist() == [2, 2, 3]
    assert again.other["extra"].to_pylist() == ["x", "y", ""]
    assert (tmp_path / "b.csv").read_text().splitlines()[0] == "time_s,speed_rad_s,current_command_A,extra"


def test_a_constant_current_becomes_a_column(tmp_path: Path) -> None:
    """Proves that a mapped coast-down can be exported and read without its map."""
    log = WheelLog(
        name="made", time_s=np.arange(3.0), speed_rad_s=np.ones(3), current_A=np.zeros(3), drive="constant",
        command_delay_s=np.zeros(3), segment=np.zeros(3, dtype=np.int64)
    )  # fmt: skip
    log.save(tmp_path / "b.parquet")
    again = read_log(tmp_path / "b.parquet")
    assert (again.current_A.tolist(), again.drive) == ([0, 0, 0], "current_command_A")


def test_every_log_column_has_its_place() -> None:
    """Proves that the fixed order covers the fields of a log."""
    assert LOG_COLUMNS[:2] == ("time_s", "speed_rad_s")
    assert {"time_s", "speed_rad_s", "command_delay_s", "segment"} <= {f.name for f in dataclasses.fields(WheelLog)}


def test_a_table_of_mixed_columns(tmp_path: Path) -> None:
    """Proves that texts, booleans and gaps are written as a reader expects them."""
    columns = {"x": np.array([0.1, np.nan]), "ok": [True, None], "reason": ["a,b", None], "a b": [1, 2]}
    write_table(tmp_path / "t.csv", columns)
    assert (tmp_path / "t.csv").read_text() == 'x,ok,reason,a b\n0.1,true,"a,b",1\n,,,2\n'
    for suffix in (".parquet", ".mat"):
        write_table(tmp_path / f"t{suffix}", columns)
        assert (tmp_path / f"t{suffix}").stat().st_size > 0


@pytest.mark.parametrize("name", ["out.xlsx", "out", "missing/out.csv"])
def test_places_that_cannot_be_written(tmp_path: Path, name: str) -> None:
    """Proves that an unknown suffix or a missing directory is one sentence."""
    with pytest.raises(BadInputError, match="out"):
        write_table(tmp_path / name, {"x": [1.0]})


def test_a_directory_is_no_place_for_a_table(tmp_path: Path) -> None:
    """Proves that a directory with a fitting name is refused."""
    (tmp_path / "d.csv").mkdir()
    with pytest.raises(BadInputError, match="directory"):
        write_table(tmp_path / "d.csv", {"x": [1.0]})


def test_a_failure_leaves_the_old_file_and_no_rubbish(tmp_path: Path) -> None:
    """Proves that a file is either replaced whole or left alone."""
    target = tmp_path / "a.txt"
    target.write_text("old")

    def fail() -> None:
        with atomic_path(target) as temporary:
            temporary.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert target.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_devices_and_links_are_not_replaced(tmp_path: Path) -> None:
    """Proves that /dev/null stays a device and a symbolic link a link."""
    write_table("/dev/null", {"x": [1.0]})
    assert Path("/dev/null").is_char_device()
    (tmp_path / "real.csv").write_text("old")
    (tmp_path / "link.csv").symlink_to(tmp_path / "real.csv")
    write_table(tmp_path / "link.csv", {"x": [1.0]})
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_text() == "x\n1\n"
