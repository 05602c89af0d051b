"""CSV files, slowly but with the place of every cell: for files that the fast reader refuses, and for messages."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from rw_ekf.errors import EmptyLogError, LogError
from rw_ekf.logs.column_map import CsvLayout
from rw_ekf.logs.log_text import LogText
from rw_ekf.logs.raw_table import RawTable, number_or_none

_MAX_SHOWN = 40  # characters of a bad cell in a message


class OddRowError(LogError):
    """A row is none of the table that its header and its columns of numbers promise."""


class NoNumberError(OddRowError):
    """A cell of a column of numbers holds something else."""


@dataclass(frozen=True)
class CsvFile:
    """A CSV file whose header has been read."""

    text: LogText
    layout: CsvLayout
    names: tuple[str, ...]
    has_header: bool
    first_line: int  # physical line (from 1) where the data start
    numeric: tuple[bool, ...]  # columns that must hold numbers


def read_slowly(file: CsvFile, name: str) -> RawTable:
    """Read the file cell by cell; a truncated last line is dropped with a warning.

    Raises LogError naming line and column of the first cell that is wrong.
    """
    columns: list[list[Any]] = [[] for _ in file.names]
    lines: list[int] = []
    warnings: list[str] = []
    with _rows(file, name) as rows:
        pending: tuple[int, list[str]] | None = None
        for row in rows:
            if pending is not None:
                _append(file, name, columns, lines, pending)
            pending = row
    if pending is not None:
        _check_quotes(file, name, pending)
        cut = _truncation(file, pending)
        if cut is None:
            _append(file, name, columns, lines, pending)
        else:
            warnings.append(f"{name}: line {pending[0]}: the last line is truncated ({cut}) and was dropped")
    if not lines:
        rest = f" ({warnings[0]})" if warnings else ""
        what = "has a header but no rows" if file.has_header else "has no rows"
        raise EmptyLogError(f"{name}: {what}: nothing was logged{rest}")
    arrays = [_array(cells, numeric) for cells, numeric in zip(columns, file.numeric, strict=True)]
    return RawTable(name, file.names, arrays, len(lines), lambda row: f"line {lines[row]}", warnings)


def place_finder(file: CsvFile) -> Callable[[int], str]:
    """Make the function that finds the physical line of a data row; it reads the file again only if it is called."""

    def place(row: int) -> str:
        with _rows(file, str(file.text.path)) as rows:
            for index, (line, _) in enumerate(rows):
                if index == row:
                    return f"line {line}"
        return f"row {row + 1}"

    return place


@contextmanager
def _rows(file: CsvFile, name: str) -> Iterator[Iterator[tuple[int, list[str]]]]:
    """Rows that are not blank, each with its physical line; faults of the text itself become LogError."""
    with io.TextIOWrapper(file.text.open(), encoding="utf-8-sig", newline="") as stream:
        for _ in range(file.first_line - 1):
            stream.readline()
        reader = csv.reader(stream, delimiter=file.layout.separator)

        def rows() -> Iterator[tuple[int, list[str]]]:
            start = file.first_line
            try:
                for cells in reader:
                    if cells and not (len(cells) == 1 and not cells[0].strip() and len(file.names) > 1):
                        yield start, cells
                    start = file.first_line + reader.line_num
            except csv.Error as error:
                raise LogError(f"{name}: line {start}: cannot be split into columns ({error})") from None
            except UnicodeDecodeError as error:
                raise LogError(f"{name}: {_bad_byte(file, error)}: save the log as UTF-8") from None

        yield rows()


def _append(file: CsvFile, name: str, columns: list[list[Any]], lines: list[int], row: tuple[int, list[str]]) -> None:
    line, cells = row
    if len(cells) != len(file.names):
        longer = "; a decimal comma, or another delimiter?" if len(cells) > len(file.names) else ""
        hint = ", as the rows before it: mend or remove that line" if lines and len(file.names) > 1 else longer
        known = "the header has" if file.has_header else "the first row has"
        raise OddRowError(f"{name}: line {line}: {len(cells)} fields where {known} {len(file.names)}{hint}")
    for index, cell in enumerate(cells):
        value = number_or_none(cell) if file.numeric[index] else cell
        if value is None:
            column = f"column '{file.names[index]}'" if file.names[index] else f"column {index}"
            raise NoNumberError(
                f"{name}: line {line}, {column}: {_shown(cell)} is not a number: mend the cell, or leave it empty "
                "for a gap"
            )
        columns[index].append(value)
    lines.append(line)


def _check_quotes(file: CsvFile, name: str, row: tuple[int, list[str]]) -> None:
    """Raise LogError if the last row is really the rest of the file, swallowed by a quote that was never closed."""
    line, cells = row
    if len(cells) != len(file.names) and any("\n" in cell or "\r" in cell for cell in cells):
        raise LogError(f"{name}: line {line}: a quote is opened and never closed: remove it")


def _truncation(file: CsvFile, row: tuple[int, list[str]]) -> str | None:
    """Why the last row is taken for truncated; None if it is whole."""
    cells = row[1]
    if any("\x00" in cell for cell in cells):
        return "it holds zero bytes, as after a loss of power"
    if len(cells) < len(file.names):
        return f"{len(cells)} of {len(file.names)} fields"
    if len(cells) == len(file.names) and not _ends_with_newline(file):
        bad = [
            cell for cell, numeric in zip(cells, file.numeric, strict=True) if numeric and number_or_none(cell) is None
        ]
        if bad:
            return f"{_shown(bad[0])} is not a number"
    return None


def _ends_with_newline(file: CsvFile) -> bool:
    with file.text.open() as stream:
        stream.seek(-1, 2)
        return stream.read(1) in b"\r\n"


def _bad_byte(file: CsvFile, error: UnicodeDecodeError) -> str:
    """Place of the first byte that is not UTF-8."""
    with file.text.open() as stream:
        data = stream.read()
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as whole:
        line = data.count(b"\n", 0, whole.start) + 1
        return f"line {line}: not UTF-8 text (byte {data[whole.start]:#04x})"
    return f"not UTF-8 text ({error.reason})"


def _array(cells: list[Any], numeric: bool) -> Any:
    """Numbers as float64; other columns as numbers if all cells are such, else as text."""
    import pyarrow as pa

    if numeric:
        return pa.array(cells, type=pa.float64())
    values = [number_or_none(cell) for cell in cells]
    return pa.array(cells, type=pa.string()) if None in values else pa.array(values, type=pa.float64())


def _shown(cell: str) -> str:
    text = cell.strip()
    return repr(text if len(text) <= _MAX_SHOWN else text[:_MAX_SHOWN] + "...")
