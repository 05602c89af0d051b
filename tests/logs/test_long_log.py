"""A log that is read in parts has the rows of the log read as a whole, whatever is wrong with it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.errors import LogError
from rw_ekf.logs import csv_table, long_log, parquet_table
from rw_ekf.logs.column_map import ColumnMap, Source
from rw_ekf.logs.in_parts import UnsoundError
from rw_ekf.logs.long_log import LongLog, long_log_of
from rw_ekf.logs.parts import part_path
from rw_ekf.logs.raw_table import RawTable
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.tables import write_table
from rw_ekf.logs.wheel_log import WheelLog

ROWS = 3000
ARRAYS = ("time_s", "speed_rad_s", "current_A", "command_delay_s")


@pytest.fixture(autouse=True)
def _small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts of some hundred rows, each with a second of the one before."""
    monkeypatch.setattr(long_log, "LONG_ROWS", 1000)
    monkeypatch.setattr(long_log, "BEFORE_S", 1.0)
    monkeypatch.setattr(csv_table, "_ROWS_AT_ONCE", 150)
    monkeypatch.setattr(parquet_table, "_ROWS_AT_ONCE", 257)


def columns_of(seed: int) -> dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]]:
    """A log in segments, with rows that repeat a time, gaps of current and speed, and further columns."""
    rng = np.random.default_rng(seed)
    segment = np.cumsum(rng.random(ROWS) < 0.002).astype(np.float64)
    time_s = 0.1 * np.arange(ROWS) - 40.0 * segment
    again = rng.choice(np.arange(1, ROWS), 12, replace=False)
    time_s[again] = time_s[again - 1] - 0.05 * rng.random(12)
    speed = np.where(rng.random(ROWS) < 0.03, np.nan, 20.0 * np.sin(0.01 * np.arange(ROWS)))
    current = np.where(rng.random(ROWS) < 0.05, np.nan, np.repeat(rng.normal(0.0, 0.1, ROWS // 10), 10))
    return {
        "time_s": time_s,
        "speed_rad_s": speed,
        "current_command_A": current,
        "command_delay_s": np.where(rng.random(ROWS) < 0.5, np.nan, 0.03),
        "segment": segment,
        "temperature_degC": 20.0 + 0.001 * np.arange(ROWS),
        "tank_K": 300.0 + rng.normal(0.0, 1.0, ROWS),
    }


def opened(path: Path, columns: ColumnMap | None = None) -> LongLog:
    """The log, which must be one that can be read in parts."""
    log = long_log_of(path, columns or ColumnMap(), ("tank_K",))
    assert log is not None
    return log


def put_together(log: LongLog, *, again: bool = False) -> WheelLog:
    """The rows of all parts, none twice."""
    parts = list(log.parts(again=again))
    assert len(parts) > 5
    assert [part.first_row for part in parts] == list(np.cumsum([0, *(len(p.log) - p.begin for p in parts[:-1])]))
    last = parts[-1].log
    arrays: dict[str, Any] = {name: np.concatenate([getattr(p.log, name)[p.begin :] for p in parts]) for name in ARRAYS}
    opens = [p.log.segment[p.begin :] != np.roll(p.log.segment, 1)[p.begin :] for p in parts]
    opens[0][0] = False
    channels = {name: np.concatenate([p.log.channels[name][p.begin :] for p in parts]) for name in last.channels}
    tanks = [tank for p in parts if (tank := p.log.numbers("tank_K")) is not None]
    other = {"tank_K": np.concatenate([tank[p.begin :] for tank, p in zip(tanks, parts, strict=True)])} if tanks else {}
    return replace(last, segment=np.cumsum(np.concatenate(opens)), channels=channels, other=other, **arrays)


def assert_same(parts: WheelLog, whole: WheelLog) -> None:
    """The same rows."""
    for name in (*ARRAYS, "segment"):
        assert np.array_equal(getattr(parts, name), getattr(whole, name), equal_nan=name == "speed_rad_s"), name
    assert (parts.drive, parts.rows_read, parts.skipped_rows) == (whole.drive, whole.rows_read, whole.skipped_rows)
    tank = whole.numbers("tank_K")
    if tank is not None:
        assert np.array_equal(parts.other["tank_K"], tank)
        assert np.array_equal(parts.channels["temperature_degC"], whole.channels["temperature_degC"])


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize("seed", range(4))
def test_the_rows_and_what_is_said_of_them_are_the_same(tmp_path: Path, suffix: str, seed: int) -> None:
    """Rows out of order are skipped, gaps held and segments told apart across the edges of parts as within them."""
    path = tmp_path / f"log{suffix}"
    write_table(path, columns_of(seed))
    log, whole = opened(path), read_log(path)
    assert_same(put_together(log), whole)
    assert log.warnings == whole.warnings
    assert len(log) == len(whole)


def test_the_parts_of_a_run_are_one_log(tmp_path: Path) -> None:
    """Files of one run follow each other like parts of one file."""
    columns = columns_of(9)
    first = tmp_path / "run.csv"
    for number, rows in enumerate((slice(0, 1300), slice(1300, None)), start=1):
        write_table(part_path(first, number), {name: values[rows] for name, values in columns.items()})
    assert_same(put_together(opened(first)), read_log(first))


def test_a_map_of_columns_holds_for_each_part(tmp_path: Path) -> None:
    """Scale and name of a column are those of the map; a log in rpm is said to be one."""
    path = tmp_path / "log.csv"
    columns = columns_of(3)
    columns["n"] = columns.pop("speed_rad_s")
    write_table(path, columns)
    named = ColumnMap(sources={"speed_rpm": Source("column", "n", scale=-2.0)})
    parts = put_together(opened(path, named))
    assert_same(parts, read_log(path, named))
    assert parts.in_rpm


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_value_that_cannot_be_is_placed_as_in_the_whole(tmp_path: Path, suffix: str) -> None:
    """An infinite speed far down is refused with its line and column, by the same sentence."""
    path = tmp_path / f"log{suffix}"
    columns = columns_of(1)
    columns["speed_rad_s"][2345] = np.inf
    write_table(path, columns)
    with pytest.raises(LogError) as whole:
        read_log(path)
    with pytest.raises(LogError) as parts:
        list(opened(path).parts())
    assert str(parts.value) == str(whole.value)
    assert "234" in str(parts.value)


def test_too_many_rows_out_of_order_are_refused_alike(tmp_path: Path) -> None:
    """Above one in a hundred, with the same count and place."""
    path = tmp_path / "log.csv"
    columns = columns_of(2)
    columns["time_s"][::50] = columns["time_s"][0]
    write_table(path, columns)
    with pytest.raises(LogError) as whole:
        read_log(path)
    with pytest.raises(LogError) as parts:
        list(opened(path).parts())
    assert str(parts.value) == str(whole.value)


@pytest.mark.parametrize(
    "columns",
    [
        ColumnMap(decimate=5),
        ColumnMap(reverse=True),
        ColumnMap(rate_hz=10.0),
        ColumnMap(repeats="spread"),
        ColumnMap(sources={"time_s": Source("column", "time_s", wrap=100.0)}),
        ColumnMap(sources={"speed_rad_s": Source("derivative", "tank_K")}),
    ],
)
def test_what_has_to_be_seen_as_a_whole_is(tmp_path: Path, columns: ColumnMap) -> None:
    """A map that says of a row what depends on others far away makes no parts."""
    path = tmp_path / "log.csv"
    write_table(path, columns_of(5))
    assert long_log_of(path, columns) is None


def foreign() -> dict[str, Float64Array]:
    """A table of somebody else's names, that says of each column what it is."""
    at = np.arange(ROWS, dtype=np.float64)
    rng = np.random.default_rng(4)
    return {
        "t_ms": 100.0 * at,
        "wheel_speed [rpm]": 200.0 * np.sin(0.01 * at) + rng.normal(0.0, 1.0, ROWS),
        "motor current [mA]": 100.0 * np.cos(0.01 * at),
        "bus [V]": rng.normal(28.0, 0.1, ROWS),
    }


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_foreign_table_is_read_in_parts_as_it_is_as_a_whole(tmp_path: Path, suffix: str) -> None:
    """What its columns are is told from its first rows, and said by the same sentence."""
    path = tmp_path / f"lab{suffix}"
    write_table(path, foreign())
    log, whole = long_log_of(path, ColumnMap()), read_log(path)
    assert log is not None
    assert_same(put_together(log), whole)
    assert log.warnings == whole.warnings
    assert "current_A = motor current" in log.warnings[0].replace("'", "")


def changed(name: str) -> dict[str, Float64Array]:
    """The same with what it says of its columns other behind row 2,000."""
    columns = foreign()
    late = slice(2000, None)
    if name == "its clock begins anew":
        columns["t_ms"][late] -= 200_000.0
    elif name == "a second current":
        columns["current setpoint [A]"] = columns["motor current [mA]"].copy()
        columns["current setpoint [A]"][:2000] = np.nan
    elif name == "rows without a time":
        columns["t_ms"][2500] = np.nan
    elif name == "its clock is two":
        columns["time_s"] = columns["t_ms"].copy()
        columns["time_s"] *= 1.0e-3
        columns["time_s"][late] += 400.0
    return columns


@pytest.mark.parametrize(
    "name", ["its clock begins anew", "rows without a time", "its clock is two", "a second current"]
)
def test_a_foreign_table_whose_later_rows_say_otherwise_is_read_as_a_whole(tmp_path: Path, name: str) -> None:
    """No row is read by what the first rows said where the whole says, or asks, something else."""
    path = tmp_path / "lab.csv"
    write_table(path, changed(name))
    try:
        whole: WheelLog | str = read_log(path)
    except LogError as error:
        whole = str(error)
    log = long_log_of(path, ColumnMap())
    try:
        parts = None if log is None else put_together(log)
    except UnsoundError:
        parts = None
    if parts is not None:
        assert isinstance(whole, WheelLog)
        assert_same(parts, whole)


@pytest.mark.parametrize("unit", ["", " [dps]"])
def test_a_foreign_table_that_asks_a_question_makes_no_parts(tmp_path: Path, unit: str) -> None:
    """A speed in no unit: somebody has to say which, before a row is read."""
    path = tmp_path / "lab.csv"
    columns = foreign()
    columns[f"speed{unit}"] = columns.pop("wheel_speed [rpm]")
    write_table(path, columns)
    log = long_log_of(path, ColumnMap())
    assert (log is None) == (unit == "")


def test_a_short_log_is_held(tmp_path: Path) -> None:
    """What fits into memory is read at once: all that is known of it is then known of all of it."""
    path = tmp_path / "log.csv"
    write_table(path, {name: values[:900] for name, values in columns_of(6).items()})
    assert long_log_of(path, ColumnMap()) is None


@pytest.mark.parametrize(
    ("kept_bytes", "again", "readings"), [(10_000_000, True, 1), (10_000_000, False, 3), (100_000, True, 3)]
)
def test_a_log_that_is_not_much_too_long_is_read_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kept_bytes: int, again: bool, readings: int
) -> None:
    """Where its parts are asked for again; one that is longer, or is not, is read each time, to the same rows."""
    monkeypatch.setattr(long_log, "_KEPT_BYTES", kept_bytes)
    write_table(tmp_path / "log.csv", columns_of(9))
    log, whole = opened(tmp_path / "log.csv"), LongLog._tables
    read: list[str] = []

    def counted(self: LongLog) -> Iterator[RawTable]:
        read.append(self.name)
        return whole(self)

    monkeypatch.setattr(LongLog, "_tables", counted)
    found = [put_together(log, again=again) for _ in range(3)]
    assert len(read) == readings
    for name in ARRAYS:
        assert all(np.array_equal(getattr(one, name), getattr(found[0], name), equal_nan=True) for one in found[1:])
    next(log.parts())  # one that is not gone through leaves what is kept as it is
    assert len(put_together(log)) == len(found[0])
