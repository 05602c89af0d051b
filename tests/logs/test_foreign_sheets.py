"""Spreadsheets are read as tables: header, units, dates, times of day, several sheets."""

from __future__ import annotations

import datetime
import math
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pytest

import rw_ekf
from rw_ekf.errors import LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.reader import read_log, read_table
from tests.foreign_logs import (
    Record,
    assert_same,
    assert_says_what_to_install,
    assert_survives_damage,
    read_with,
    refusal,
)

MAP = ("time_s: t", "speed_rad_s: w", "current_A: i")


def save(path: Path, sheets: dict[str, list[list[Any]]]) -> Path:
    """An XLSX file with these sheets, row by row."""
    book = openpyxl.Workbook()
    book.remove(book.worksheets[0])
    for title, rows in sheets.items():
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def rows_of(record: Record) -> list[list[Any]]:
    """Time, speed and current, row by row."""
    return [list(row) for row in np.c_[record.time_s, record.speed, record.current].tolist()]


def test_a_sheet_is_read_as_it_was_written(tmp_path: Path) -> None:
    """A preamble, a blank row, a note beside it and a sheet of remarks are no obstacle, and no digit is lost."""
    record = Record(1, digits=6)
    rows: list[list[Any]] = [["Bench 3"], ["rate", 4], [], ["t", "w", "i", "note"], *rows_of(record)]
    rows[7].append("warm")
    path = save(tmp_path / "a.xlsx", {"Remarks": [["nothing to see"]], "Run": rows})
    log = read_with(path, *MAP)
    assert_same(log, record)
    assert log.other["note"].to_pylist()[3] == "warm"
    assert_same(read_with(path, "variable: Run", *MAP), record)


def test_two_runs_are_named(tmp_path: Path) -> None:
    """Where two sheets hold tables, the refusal says which there are; so it does for one that is not there."""
    first, second = Record(1, digits=6), Record(2, digits=6)
    head = ["t", "w", "i"]
    path = save(tmp_path / "a.xlsx", {"up": [head, *rows_of(first)], "down": [head, *rows_of(second)]})
    assert "2 sheets hold tables (up, down): name one (`variable`" in refusal(path, *MAP)
    assert "has no sheet 'side'; sheets: up, down" in refusal(path, "variable: side", *MAP)
    assert_same(read_with(path, "variable: down", *MAP), second)


def test_units_below_the_names_are_part_of_them(tmp_path: Path) -> None:
    """A row of units goes into the names, where a unit that the map forgets is seen."""
    path = save(tmp_path / "a.xlsx", {"a": [["t", "n", "i"], ["s", "rpm", "(A)"], *rows_of(Record(3, digits=6))]})
    log = read_with(path, "time_s: 't [s]'", "speed_rpm: 'n [rpm]'", "current_A: 'i [A]'")
    assert log.in_rpm
    log = read_with(path, "time_s: 't [s]'", "speed_rad_s: 'n [rpm]'", "current_A: 'i [A]'")
    assert "its name says rpm" in log.faults[0]


@pytest.mark.parametrize(
    "above",
    [
        [["group", "wheel", "motor", None], ["signal", "speed", "current", "current_cmd"],
         ["unit", "deg/s", "mA", "mA"], ["t [ms]"]],  # pandas to_excel, whose cells of one group are merged
        [["Run 7"], ["Time", "Wheel speed", "Motor current", "Housing"], ["ms", "deg/s", "mA", "degC"],
         ["vacuum", "Hall, signed", "LEM LTS 6-NP", "PT100"]],
        [["time [ms]", "Wheel\nspeed", "Motor current", "Command"], [None, "Unit: deg/s", "Unit: mA", "Unit: mA"],
         [None, "Type: double", "Type: double", "Type: double"]],
        [["", "measured", None, "set-point"], ["t [ms]", 'speed, "filtered" [deg/s]', "current [mA]", "current [A]"]],
    ],
)  # fmt: skip
def test_what_stands_above_a_sheet_s_numbers_is_read_as_in_a_text(tmp_path: Path, above: list[list[Any]]) -> None:
    """Levels, remarks below the units, a key at each cell, a row of groups: each column in its unit."""
    run = rw_ekf.simulate("steps", duration_s=60.0, seed=5)
    values = np.c_[np.arange(len(run)) * 100, np.degrees(run.speed_rad_s), 1e3 * run.current_A, np.full(len(run), 0.5)]
    path = save(tmp_path / "a.xlsx", {"a": [*above, *values.tolist()]})
    log = rw_ekf.read(path)
    assert np.allclose(log.time_s, 0.1 * np.arange(len(run)))
    assert np.allclose(log.speed_rad_s, run.speed_rad_s)
    assert np.allclose(log.current_A, run.current_A)


def test_a_column_without_a_name_moves_no_other_s(tmp_path: Path) -> None:
    """One name fewer than cells, above a count of the rows, is an index in a text; in a sheet each has its place."""
    rows = [[row, 10.0 * math.sin(row), 0.5, 7.0] for row in range(50)]
    path = save(tmp_path / "a.xlsx", {"a": [["t [s]", "n [rpm]", "I [A]"], *rows]})
    assert read_table(path, ColumnMap()).names == ("t [s]", "n [rpm]", "I [A]", "")


def test_dates_and_times_of_day_are_seconds(tmp_path: Path) -> None:
    """A date is seconds since 1970; a time of day is seconds, and goes on past midnight."""
    noon = datetime.datetime(2024, 5, 1, 12, 0, 0)
    days = [noon + datetime.timedelta(seconds=0.5 * row) for row in range(4)]
    path = save(tmp_path / "a.xlsx", {"a": [["t", "w", "i"], *([day, 1.0, 2.0] for day in days)]})
    assert read_with(path, *MAP).time_s.tolist() == [1714564800.0 + 0.5 * row for row in range(4)]
    book = openpyxl.Workbook()
    sheet = book.worksheets[0]
    sheet.append(["t", "w", "i"])
    for row in range(4):
        sheet.append([(86390.0 + 5.0 * row) / 86400.0, 1.0, 2.0])
        sheet.cell(row=row + 2, column=1).number_format = "h:mm:ss"
    book.save(tmp_path / "b.xlsx")
    assert np.allclose(read_with(tmp_path / "b.xlsx", *MAP).time_s, [86390, 86395, 86400, 86405])


def test_numbers_that_are_texts_are_read_as_those_of_a_text(tmp_path: Path) -> None:
    """A sheet into which a CSV was pasted has `12,5` and `10:31:05,1` as words: they are numbers and times."""
    rows = [[f"10:31:{0.1 * row:04.1f}".replace(".", ","), f"{row % 7},5", f"-{row},25"] for row in range(60)]
    log = rw_ekf.read(save(tmp_path / "a.xlsx", {"a": [["Uhrzeit", "Drehzahl in 1/min", "Strom in mA"], *rows]}))
    assert np.allclose(log.time_s - log.time_s[0], 0.1 * np.arange(60.0))
    assert np.allclose(1e3 * log.current_A, -np.arange(60.0) - 0.25)


def test_the_form_of_a_date_is_no_unit_of_it(tmp_path: Path) -> None:
    """`hh:mm:ss.000` below the name of dates says how they are shown: nothing is asked; of plain numbers it is."""
    noon = datetime.datetime(2024, 5, 1, 12, 0, 0)
    head: list[list[Any]] = [["Time", "Speed", "Current"], ["hh:mm:ss.000", "rpm", "mA"]]
    rows = [[0.1 * row, 100.0 * math.sin(0.1 * row), 300.0 * math.cos(0.1 * row)] for row in range(60)]
    stamped = [[noon + datetime.timedelta(seconds=t), speed, current] for t, speed, current in rows]
    log = rw_ekf.read(save(tmp_path / "a.xlsx", {"a": [*head, *stamped]}))
    assert np.allclose(log.time_s - log.time_s[0], 0.1 * np.arange(60.0))
    with pytest.raises(LogError, match="what does 'hh:mm:ss"):
        rw_ekf.read(save(tmp_path / "b.xlsx", {"a": [*head, *rows]}))


def test_a_row_of_means_and_cells_of_nothing_are_no_numbers(tmp_path: Path) -> None:
    """What begins with a word among rows that begin with a number is left out with a word; `n/a` is a gap."""
    record = Record(6, digits=6)
    rows = [["t [s]", "w [rad/s]", "I [A]"], *rows_of(record), [], ["Mean", 0.5, 0.25]]
    rows[4][2] = "n/a"
    log = rw_ekf.read(save(tmp_path / "a.xlsx", {"Run": rows}))
    assert np.array_equal(log.speed_rad_s, record.speed)
    assert any("1 rows of the sheet, first row 63, begin with a word" in text for text in log.warnings)


def test_a_sheet_without_names_goes_by_number(tmp_path: Path) -> None:
    """Numbers from the first row on are data; a text among them is named by its row of the sheet."""
    record = Record(4, digits=6)
    numbers = ("time_s: {column: 0}", "speed_rad_s: {column: 1}", "current_A: {column: 2}")
    path = save(tmp_path / "a.xlsx", {"a": rows_of(record)})
    assert_same(read_with(path, *numbers), record)
    rows = rows_of(record)
    rows[9][1] = "broken"
    assert "row 10 of the sheet, column '1': 'broken' is not a number" in refusal(
        save(tmp_path / "b.xlsx", {"a": rows}), *numbers
    )


def test_what_cannot_be_read_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An archive that is no sheet, a sheet without numbers, a damaged one, a library that is missing: LogErrors."""
    path = save(tmp_path / "a.xlsx", {"a": [["t", "w", "i"], *rows_of(Record(5, digits=6))]})
    assert_says_what_to_install(monkeypatch, path, "python_calamine", "xlsx")
    assert_survives_damage(path, *MAP)
    assert "no sheet (a) holds a table" in refusal(save(tmp_path / "b.xlsx", {"a": [["t"], ["u"]]}), *MAP)
    (tmp_path / "c.xls").write_bytes(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + b"\0" * 600)
    assert "is a spreadsheet that is damaged" in refusal(tmp_path / "c.xls", *MAP)


def test_columns_of_the_log_s_own_names_need_no_map(tmp_path: Path) -> None:
    """A sheet with the log's columns is a log."""
    record = Record(6, digits=6)
    path = save(tmp_path / "a.xlsx", {"a": [["time_s", "speed_rad_s", "current_A"], *rows_of(record)]})
    assert_same(read_log(path), record)


def test_a_sheet_of_words_beside_the_table_is_heard(tmp_path: Path) -> None:
    """What an `Info` sheet says of the numbers is asked about."""
    book = openpyxl.Workbook()
    info = book.active
    assert info is not None
    info.title = "Info"
    info.append(["speed", "electrical, 7 pole pairs"])
    sheet = book.create_sheet("data")
    sheet.append(["t [s]", "n [rpm]", "I [A]"])
    for i in range(100):
        sheet.append([0.1 * i, 100.0 * math.sin(0.1 * i), 0.1 * math.cos(0.1 * i)])
    book.save(tmp_path / "a.xlsx")
    wanted = rw_ekf.guess_columns(tmp_path / "a.xlsx").guess.questions
    assert [question.name for question in wanted] == ["speed_rpm"]
