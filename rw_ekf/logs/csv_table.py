"""CSV files, fast: pyarrow reads what is sound; what is not goes to `csv_slow`, which knows the line and the column."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rw_ekf.errors import EmptyLogError, LogError
from rw_ekf.logs import csv_slow
from rw_ekf.logs.log_text import HEAD_BYTES, LogText, check_head
from rw_ekf.logs.raw_table import RawTable, number_or_none

if TYPE_CHECKING:
    import pyarrow as pa

_BLOCK_BYTES = 1 << 22  # read and parsed at a time: a fifth less work than by pyarrow's own 1 MB
_STAMP = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d")
_GAPS = ["", "nan", "NaN", "NAN", "Nan"]  # rarer spellings and blanks are settled by the slow pass


@dataclass(frozen=True)
class CsvLayout:
    """How the text is laid out. `header` None: there is one unless the first row holds numbers only."""

    delimiter: str = ","
    skip_rows: int = 0  # physical lines before the header
    header: bool | None = None


@dataclass(frozen=True)
class CsvFile:
    """A CSV file whose header has been read."""

    text: LogText
    layout: CsvLayout
    names: tuple[str, ...]
    has_header: bool
    first_line: int  # physical line (from 1) where the data start
    numeric: tuple[bool, ...]  # columns that must hold numbers


def read_csv_table(
    text: LogText, layout: CsvLayout, must_be_numeric: Callable[[int, str], bool], name_shown: str
) -> RawTable:
    """Read a CSV file; columns for which `must_be_numeric(number, name)` holds become float64, others as they are.

    Raises LogError naming the line and the column of the first fault, EmptyLogError for a file without data.
    """
    names, has_header, first_line = _header(text, layout, name_shown)
    numeric = tuple(must_be_numeric(index, name) for index, name in enumerate(names))
    file = CsvFile(text, layout, names, has_header, first_line, numeric)
    table = _fast(file)
    if table is None:
        read = csv_slow.read_slowly(file, name_shown)
    elif table.num_rows == 0:
        raise EmptyLogError(
            f"{name_shown}: {'has a header but no rows' if has_header else 'has no rows'}: nothing was logged"
        )
    else:
        read = RawTable(name_shown, names, list(table.columns), table.num_rows, csv_slow.place_finder(file))
    if text.torn is not None:
        read.warnings.append(
            f"{name_shown}: is a damaged or incomplete compressed file ({text.torn}); the {read.rows} rows before that "
            "were read"
        )
    return read


def _fast(file: CsvFile) -> pa.Table | None:
    """Let pyarrow read the file; None where it stumbles, for whatever reason."""
    import pyarrow as pa
    import pyarrow.csv as pa_csv

    keys = [str(index) for index in range(len(file.names))]  # positions: names may repeat, or have blanks around
    types = {
        key: pa.float64()
        for key, numeric, stamp in zip(keys, file.numeric, _stamps(file), strict=True)
        if numeric and not stamp
    }
    try:
        with file.text.for_arrow() as text:
            table = pa_csv.read_csv(
                text,
                read_options=pa_csv.ReadOptions(
                    skip_rows=file.first_line - 1, column_names=keys, block_size=_BLOCK_BYTES
                ),
                parse_options=pa_csv.ParseOptions(delimiter=file.layout.delimiter),
                convert_options=pa_csv.ConvertOptions(column_types=types, null_values=_GAPS),
            )
    except (pa.ArrowException, OSError, ValueError):
        return None
    # Text that is not UTF-8 comes back as bytes: let the slow pass say where it is.
    return None if any(pa.types.is_binary(field.type) for field in table.schema) else table


def _stamps(file: CsvFile) -> list[bool]:
    """Of each column, whether its first cell is a date with a time (ISO 8601), which arrow reads as such."""
    with file.text.open() as stream:
        lines = stream.read(HEAD_BYTES).decode("utf-8", "replace").splitlines()[file.first_line - 1 :][:1]
    try:
        cells = next(csv.reader(lines, delimiter=file.layout.delimiter), [])
    except csv.Error:  # the slow pass will say where
        cells = []
    return [bool(_STAMP.match(cell.strip())) for cell in cells[: len(file.names)]] + [False] * (
        len(file.names) - len(cells)
    )


def _header(source: LogText, layout: CsvLayout, name: str) -> tuple[tuple[str, ...], bool, int]:
    """Column names, whether they come from a header row, and the physical line (from 1) where the data start."""
    with source.open() as stream:
        head = stream.read(HEAD_BYTES)
    text = _decoded(head, name)
    lines = re.split(r"\r\n|\n|\r", text)  # as the readers of the rest do; splitlines() knows more line ends
    number = layout.skip_rows
    while number < len(lines) and not lines[number].strip():
        number += 1
    if number >= len(lines):
        skipped = f" after the {layout.skip_rows} skipped rows" if layout.skip_rows else ""
        raise EmptyLogError(f"{name}: the file is empty{skipped}: there is no header and no row")
    try:
        cells = next(csv.reader(io.StringIO(lines[number]), delimiter=layout.delimiter))
    except csv.Error as error:
        raise LogError(f"{name}: line {number + 1}: the header cannot be read ({error})") from None
    has_header = layout.header
    if has_header is None:
        has_header = not all(number_or_none(cell) is not None for cell in cells)
    if not has_header:
        return tuple("" for _ in cells), False, number + 1
    return tuple(cell.strip() for cell in cells), True, number + 2


def _decoded(head: bytes, name: str) -> str:
    """Text of the first bytes. Raises LogError if they are no UTF-8 text."""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise LogError(f"{name}: is UTF-16 text: save it as UTF-8")
    first_line = head.split(b"\n", 1)[0]
    if head.startswith(b"\0") and b"," in head.lstrip(b"\0").split(b"\n", 1)[0]:
        raise LogError(
            f"{name}: begins with zero bytes, as a log does that another program cut while it was written (logrotate's "
            "copytruncate): remove them, put the header row back from that program's copy, and read both"
        )
    if b"\x00" in first_line:
        raise LogError(f"{name}: is binary, not a CSV log, nor Parquet or MATLAB: give a log in one of these forms")
    check_head(head, name)
    cut = head if len(head) < HEAD_BYTES else head[: head.rfind(b"\n") + 1]
    try:
        return cut.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = cut.count(b"\n", 0, error.start) + 1
        raise LogError(
            f"{name}: line {line}: not UTF-8 text (byte {cut[error.start]:#04x}): save the log as UTF-8, if it is "
            "text at all"
        ) from None
