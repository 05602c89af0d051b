"""Spreadsheets (XLSX, XLS, XLSB, ODS): one sheet is the table, found by its header row above numbers."""

from __future__ import annotations

import datetime
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.errors import EmptyLogError, LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.csv_table import read_csv_table
from rw_ekf.logs.foreign.format_library import Library, foreign_format
from rw_ekf.logs.header_rows import with_names
from rw_ekf.logs.log_columns import READABLE_COLUMNS
from rw_ekf.logs.log_text import LogText
from rw_ekf.logs.raw_table import RawTable, number_or_none
from rw_ekf.logs.settings_beside import beside, reported, without
from rw_ekf.logs.text_cells import CELL, TextLayout, split_cells
from rw_ekf.logs.text_layout import NEARLY_ALL, layout_of

_OLE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"  # XLS, and all that Office wrote before 2007
_ZIP = b"PK\x03\x04"
_FIRST_IN_ZIP = (b"[Content_Types].xml", b"_rels/", b"docProps/", b"xl/", b"mimetypeapplication/vnd.oasis")
_EPOCH, _DAY_0 = datetime.datetime(1970, 1, 1), datetime.datetime(1899, 12, 31)
_STAMPS = (datetime.date, datetime.time, datetime.timedelta)
_FORM = re.compile(r"\s*[\[(]?\b[ymdhs]{1,4}(?:[-/.:, T]+[ymdhs0f]{1,4})+[\])]?$", re.IGNORECASE)  # hh:mm:ss.000
_HEADER_WITHIN = 200  # rows
_STATED = 100  # rows of a sheet without a table
_BELOW = 3  # rows under a header that are looked at
_PLAIN = TextLayout()


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """The sheet that `variable` names, or the only one with a table. Raises LogError where there is no such one."""
    import python_calamine

    with path.open("rb") as stream:
        book = python_calamine.CalamineWorkbook.from_filelike(stream)
        sheets = list(book.sheet_names)
        if columns.variable is not None:
            if columns.variable not in sheets:
                raise LogError(f"{name}: has no sheet '{columns.variable}'; sheets: {', '.join(sheets)}")
            return _table(_rows(book, columns.variable), name, columns)
        held = {sheet: _rows(book, sheet) for sheet in sheets}
    found = {sheet: rows for sheet, rows in held.items() if _first_data(rows, columns) is not None}
    texts = {sheet: table for sheet, rows in held.items() if not found and (table := _of_texts(rows, name, columns))}
    if len(texts) == 1:
        return next(iter(texts.values()))
    if not found:
        raise EmptyLogError(f"{name}: no sheet ({', '.join(sheets)}) holds a table of numbers: nothing was logged")
    if len(found) > 1:
        raise LogError(
            f"{name}: {len(found)} sheets hold tables ({', '.join(found)}): name one (`variable` in the column map)"
        )
    table = _table(next(iter(found.values())), name, columns)
    beside = (row for sheet, rows in held.items() if sheet not in found for _, row in rows[:_STATED])
    table.preamble = (*table.preamble, *map(_line, beside))
    return table


def _of_texts(rows: list[tuple[int, list[Any]]], name: str, columns: ColumnMap) -> RawTable | None:
    """A sheet whose numbers are texts (`12,5`; `10:31:05,12`) as a text between tabs is read; None for no table."""
    width = max((len(row) for _, row in rows), default=0)
    text = "\n".join(_as_text(row, width).replace("\t", " ").replace(CELL, "\t") for _, row in rows) + "\n"
    layout = replace(columns.csv, delimiter="\t", skip_rows=sum(number <= columns.csv.skip_rows for number, _ in rows))
    if layout_of(text.encode(), delimiter="\t", skip_rows=layout.skip_rows) is None:
        return None
    return read_csv_table(LogText(Path(name), text.encode()), layout, columns.uses, name)


def _line(row: list[Any]) -> str:
    """What a row says, as a line of text."""
    return " ".join(str(cell) for cell in row if cell not in ("", None))


def _rows(book: Any, sheet: str) -> list[tuple[int, list[Any]]]:
    """The rows that hold something, each with its number in the sheet, from 1."""
    rows = enumerate(book.get_sheet_by_name(sheet).to_python(skip_empty_area=False), start=1)
    return [(number, row) for number, row in rows if any(cell not in ("", None) for cell in row)]


def _first_data(rows: list[tuple[int, list[Any]]], columns: ColumnMap) -> int | None:
    """Index of the first row of numbers: under a header row, mostly text, or from the beginning on; None: no table."""
    begin = sum(1 for number, _ in rows if number <= columns.csv.skip_rows)
    if columns.csv.header is False:
        return begin if begin < len(rows) else None
    for index in range(begin, min(len(rows), begin + _HEADER_WITHIN)):
        below = rows[index : index + _BELOW]
        starts = index == begin or _share_of_numbers(rows[index - 1][1]) < 0.5
        if starts and all(_share_of_numbers(row) > 0.5 for _, row in below):
            return index
    return None


def _share_of_numbers(row: list[Any]) -> float:
    """Which share of the filled cells holds a number, a date or a time."""
    filled = [cell for cell in row if cell not in ("", None)]
    return sum(_number(cell) is not None for cell in filled) / max(len(filled), 1)


def _table(rows: list[tuple[int, list[Any]]], name: str, columns: ColumnMap) -> RawTable:
    settings = beside([row for _, row in rows], lambda cell: _number(cell) is not None)
    if settings is not None:
        preset = [text for _, row in rows[: settings.last + 1] if (text := reported(row, settings))]
        table = _table([(number, without(row, settings)) for number, row in rows], name, columns)
        table.preamble = (*table.preamble, *preset)
        return table
    first = _first_data(rows, columns)
    if first is None:
        raise EmptyLogError(f"{name}: the sheet '{columns.variable}' holds no table of numbers: nothing was logged")
    data, left_out = _rows_of_data(rows[first:])
    width = max(len(row) for _, row in data)
    above = [] if columns.csv.header is False else [_as_text(row, width) for _, row in rows[:first]]
    skipped = sum(1 for number, _ in rows[:first] if number <= columns.csv.skip_rows)
    layout = with_names(above, [], TextLayout(delimiter=CELL, width=width), skipped)
    stamped = {column for _, row in data for column, cell in enumerate(row) if isinstance(cell, _STAMPS)}
    names = layout.names or ("",) * width
    names = tuple(_FORM.sub("", name) if column in stamped else name for column, name in enumerate(names))
    filled = [column for column in range(width) if names[column] or any(_cell(row, column) != "" for _, row in data)]
    numbers = np.array([number for number, _ in data])
    held = [_column([_cell(row, column) for _, row in data], names[column], column, columns, name, numbers)
            for column in filled]  # fmt: skip
    kept = tuple(names[column] for column in filled)
    stated = layout.preamble if above else [_as_text(row, width) for _, row in rows[:first]]
    preamble = tuple(" ".join(filter(None, split_cells(line, CELL))) for line in stated)
    table = RawTable(name, kept, held, len(data), lambda row: f"row {numbers[row]} of the sheet", preamble=preamble)
    table.remarks = {name: text for name, text in zip(names, layout.remarks, strict=False) if name and text}
    if left_out:
        text = f"{len(left_out)} rows of the sheet, first row {left_out[0]}, begin with a word and were left out"
        table.warnings.append(f"{name}: {text}")
    return table


def _rows_of_data(rows: list[tuple[int, list[Any]]]) -> tuple[list[tuple[int, list[Any]]], list[int]]:
    """The rows without those that begin with a word (a mean, the names again) where nearly all begin with a number.

    With the numbers of those.
    """
    begin = next((column for column, cell in enumerate(rows[0][1]) if cell not in ("", None)), 0)
    wordy = {number for number, row in rows if _number(_cell(row, begin)) is None}
    if len(wordy) > (1.0 - NEARLY_ALL) * len(rows):
        return rows, []
    return [(number, row) for number, row in rows if number not in wordy], sorted(wordy)


def _as_text(row: list[Any], width: int) -> str:
    """A row as a line of a text, a name that was broken in one piece."""
    cells = (" ".join(str(_cell(row, column)).split()) for column in range(width))
    return CELL.join(f'"{cell.replace(chr(34), chr(34) * 2)}"' if '"' in cell else cell for cell in cells)


def _cell(row: list[Any], column: int) -> Any:
    cell = row[column] if column < len(row) else ""
    return "" if cell is None else cell


def _column(cells: list[Any], title: str, column: int, columns: ColumnMap, name: str, numbers: Any) -> Any:
    """Values (n,), or texts where the log needs no numbers. Raises LogError for a text where it does."""
    values = [_number(_PLAIN.number(cell.strip()) if isinstance(cell, str) else cell) for cell in cells]
    if None not in values:
        return np.array(values, dtype=np.float64)
    if title in READABLE_COLUMNS or columns.uses(column, title):
        row = values.index(None)
        raise LogError(
            f"{name}: row {numbers[row]} of the sheet, column '{title or column}': {cells[row]!r} is not a number: "
            "mend or empty the cell"
        )
    import pyarrow as pa

    return pa.array([str(cell) for cell in cells], type=pa.string())


def _number(cell: Any) -> float | None:
    """A cell as a number: a date as seconds since 1970, a time of day as seconds; empty is NaN, a text None."""
    if isinstance(cell, str):
        return number_or_none(cell)
    if isinstance(cell, datetime.date):  # a datetime is one too
        moment = cell if isinstance(cell, datetime.datetime) else datetime.datetime.combine(cell, datetime.time())
        # A time of day that has run past midnight is a date of 1900 to the sheet, whose day 1 that year begins with.
        since = _DAY_0 if moment.year == 1900 else _EPOCH
        return (moment.replace(tzinfo=None) - since) / datetime.timedelta(seconds=1)
    if isinstance(cell, datetime.timedelta):
        return cell.total_seconds()
    if isinstance(cell, datetime.time):
        return 3600.0 * cell.hour + 60.0 * cell.minute + cell.second + 1.0e-6 * cell.microsecond
    return float(cell)


def _recognises(head: bytes, suffix: str) -> bool:
    return head.startswith(_OLE) or (head.startswith(_ZIP) and head[30:].startswith(_FIRST_IN_ZIP))


FORMAT = foreign_format(
    "a spreadsheet",
    _recognises,
    "a zip archive that begins as XLSX and ODS do, or the first bytes of XLS",
    _read,
    Library("xlsx", ("python_calamine",)),
    "save the sheet as CSV",
)
