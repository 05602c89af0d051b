"""Databases: of a file of SQLite the table with a speed, and of a dump its rows, nothing of which is run."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

import rw_ekf
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.reader import read_table
from rw_ekf.units import RAD_S_PER_RPM

ROWS = [(10.0 * k, 100.0 * k, 0.5 - 0.25 * k) for k in range(5)]


def base(path: Path, *tables: str) -> Path:
    """A file of SQLite with tables of the same rows, and one of words."""
    with closing(sqlite3.connect(path)) as held:
        held.execute("CREATE TABLE notes (id INTEGER, text TEXT)")
        held.executemany("INSERT INTO notes VALUES (?, ?)", [(1, "begin"), (2, "end")])
        for table in tables:
            held.execute(f'CREATE TABLE "{table}" (t_ms REAL, rpm REAL, motor_A REAL)')
            held.executemany(f'INSERT INTO "{table}" VALUES (?, ?, ?)', ROWS)
        held.commit()
    return path


def test_the_table_with_a_speed_is_read(tmp_path: Path) -> None:
    """Times, speeds and currents are those of the rows, and the file is as it was."""
    path = base(tmp_path / "bench.sqlite", "rw log")
    before = path.read_bytes()
    log = rw_ekf.read(path)
    assert log.time_s == pytest.approx([1e-2 * k for k in range(5)])
    assert log.current_A == pytest.approx([row[2] for row in ROWS])
    assert path.read_bytes() == before


def test_of_two_tables_the_map_names_one(tmp_path: Path) -> None:
    """Two that have a speed are asked about; `variable` takes one, and one that is not there is refused."""
    path = base(tmp_path / "bench.db", "first", "second")
    with pytest.raises(rw_ekf.Error, match="holds the tables first, second: name one"):
        rw_ekf.read(path)
    assert read_table(path, ColumnMap(variable="second")).rows == 5
    with pytest.raises(rw_ekf.Error, match="no table with rows called third"):
        read_table(path, ColumnMap(variable="third"))


def test_what_rows_point_at_is_put_in_its_place(tmp_path: Path) -> None:
    """A row for each value, whose signal is a number of another table, which has name and unit."""
    path = tmp_path / "a.sqlite"
    with closing(sqlite3.connect(path)) as held:
        held.execute("CREATE TABLE signals (id INTEGER PRIMARY KEY, name TEXT, unit TEXT)")
        held.executemany("INSERT INTO signals VALUES (?, ?, ?)", [(1, "rw_speed", "rpm"), (2, "rw_current", "mA")])
        held.execute("CREATE TABLE samples (ts_ms INTEGER, signal_id INTEGER, value REAL)")
        rows = [(10 * k, which, value) for k in range(40) for which, value in ((1, 300.0 + k), (2, 500.0 - k))]
        held.executemany("INSERT INTO samples VALUES (?, ?, ?)", rows)
        held.commit()
    log = rw_ekf.read(path)
    assert log.time_s == pytest.approx([1e-2 * k for k in range(40)])
    assert log.speed_rad_s == pytest.approx([(300.0 + k) * RAD_S_PER_RPM for k in range(40)])
    assert log.current_A == pytest.approx([0.5 - 1e-3 * k for k in range(40)])


def test_a_dump_is_parsed_and_not_run(tmp_path: Path) -> None:
    """A statement that would write a file writes none; rows of other widths are left out with a word."""
    other = tmp_path / "other.db"
    path = tmp_path / "a.sql"
    rows = "".join(f"INSERT INTO log (t_ms, rpm, motor_A) VALUES ({t}, {n}, {i});\n" for t, n, i in ROWS)
    odd = "INSERT INTO log VALUES (1, 2);\n"
    path.write_text(f"CREATE TABLE log (t_ms REAL, rpm REAL, motor_A REAL);\nATTACH '{other}' AS o;\n{rows}{odd}")
    table = read_table(path, ColumnMap())
    assert table.names == ("t_ms", "rpm", "motor_A")
    assert table.rows == 5
    assert not other.exists()
    assert any("1 rows of log have other columns" in text for text in table.warnings)
