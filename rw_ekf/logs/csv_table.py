"""CSV files, fast: pyarrow reads what is sound; what is not goes to `csv_slow`, which knows the line and the column."""

from __future__ import annotations

import csv
import io
import itertools
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.errors import EmptyLogError, LogError
from rw_ekf.logs.column_map import CsvLayout
from rw_ekf.logs.csv_slow import CsvFile, NoNumberError, OddRowError, place_finder, read_slowly
from rw_ekf.logs.in_parts import InParts, UnsoundError
from rw_ekf.logs.log_text import HEAD_BYTES, LogText, check_head
from rw_ekf.logs.plain_text import rewritten
from rw_ekf.logs.quoted_names import names_in_one_line
from rw_ekf.logs.raw_table import RawTable, number_or_none
from rw_ekf.logs.settings_beside import parted
from rw_ekf.logs.text_cells import BLANKS, TextLayout, has_units, is_stamp
from rw_ekf.logs.text_forms import stamped_form
from rw_ekf.logs.text_layout import encoding_of, layout_of, lines_of
from rw_ekf.logs.turned_text import turned

if TYPE_CHECKING:
    import pyarrow as pa

_BLOCK_BYTES = 1 << 22  # read and parsed at a time: a fifth less work than by pyarrow's own 1 MB
# Of a log that is not held as a whole: more than are looked at of a part, and half a megabyte of three columns.
_ROWS_AT_ONCE, _MOST_BLOCK_BYTES = 20_000, 1 << 21
_GAPS = ["", "nan", "NaN", "NAN", "Nan"]  # rarer spellings and blanks are settled by the slow pass
_LOOKED_AT_BYTES = 1 << 18  # to see how a text is laid out
_LOOKED_AT_ROWS = 40
_LEAST_ROWS = 3
_SHOWN = 60  # characters of a line that is quoted
_MINUS_CELL = re.compile(
    r"""(?:^|[,;\t|])[ "]*[−–][\d.,]+(?:e[+-]?\d+)?[ "]*(?:[,;\t|]|\r?$)""", re.MULTILINE | re.IGNORECASE
)
_SOME_WORDS = re.compile(rb"[A-Za-z]{3,}[^A-Za-z]+[A-Za-z]{3,}")
_EXPOSITION = re.compile(rb"^# TYPE \S+ (?:gauge|counter|untyped|histogram|summary)\s*$", re.MULTILINE)
_LAST_BYTES = 400  # of a text, in which a line of words may stand below the rows
_A_NAME = 8  # characters: a shorter line may come again by chance


def read_csv_table(
    text: LogText, layout: CsvLayout, must_be_numeric: Callable[[int, str], bool], name_shown: str
) -> RawTable:
    """Read a CSV file; columns for which `must_be_numeric(number, name)` holds become float64, others as they are.

    Raises LogError naming the line and the column of the first fault, EmptyLogError for a file without data.
    """
    head = _head_of(text)
    if not _is_own(head, layout):
        if _EXPOSITION.search(head):
            raise LogError(
                f"{name_shown}: is what a program shows to Prometheus, metrics of one moment: ask Prometheus for a "
                "range (/api/v1/query_range) and give the JSON that it answers"
            )
        if (whole := names_in_one_line(text, head)) is not None:
            return read_csv_table(replace(text, unpacked=whole), layout, must_be_numeric, name_shown)
        if (other := turned(text, head, layout.delimiter)) is not None:
            read = read_csv_table(replace(text, unpacked=other), layout, must_be_numeric, name_shown)
            return replace(read, place=lambda row: f"sample {row + 1}")
    found = _other_layout(text, layout, must_be_numeric)
    if found is not None and (cut := parted(text, head, layout.delimiter)) is not None:
        read = read_csv_table(replace(text, unpacked=cut[0]), layout, must_be_numeric, name_shown)
        read.preamble = (*read.preamble, *cut[1])
        return read
    if found is None:
        try:
            read = _read_plain(text, layout, must_be_numeric, name_shown)
        except OddRowError as error:
            found = None if _is_own(head, layout) else _layout_of(text, layout)
            if found is None and layout == CsvLayout() and not _is_own(head, layout):
                raise LogError(_no_table(head, name_shown)) from None
            if found is None or not isinstance(error, NoNumberError):  # which may stand for a gap, further behind
                raise
        else:
            found = _layout_of(text, layout) if _begins_with_numbers(read) or _holds_infinity(read) else None
            if found is None:
                return read
    with text.open() as stream:
        written = rewritten(stream.read(), found)
    above = bool(found.names) and found.first_line > 1  # names have a line of their own, as a rule
    plain = CsvLayout(",", found.first_line - 1 - above, above)
    read = _read_plain(replace(text, unpacked=written.text), plain, must_be_numeric, name_shown)
    read.preamble, read.names, read.doubts = found.preamble, found.names or read.names, found.doubts
    read.remarks = {name: text for name, text in zip(found.names, found.remarks, strict=False) if name and text}
    read.factors = {
        name: stated for name, stated in zip(found.names, found.factors, strict=False) if name and any(stated)
    }
    read.preamble = (*read.preamble, *written.words)
    if written.left_out:
        count, first = len(written.left_out), written.left_out[0]
        lines = f"line {first}" if count == 1 else f"{count} lines, first line {first},"
        read.warnings.append(f"{name_shown}: {lines} below the first row hold no row of numbers and were left out")
    gaps = [gap for gap in written.gaps if gap.column < len(read.columns) and not read.is_text(gap.column)]
    if gaps:
        texts = ", ".join(f"{text!r}" for text in dict.fromkeys(gap.text for gap in gaps))
        cells = f"{len(gaps)} cells, first in line" if len(gaps) > 1 else "a cell of line"
        read.warnings.append(
            f"{name_shown}: {texts} stands for a number in {cells} {gaps[0].line}: it is taken for a gap"
        )
    if written.another is not None:
        shown = written.another[:_SHOWN]
        read.doubts += (f"{shown!r} stands between the rows: are those behind it of the same wheel?",)
    return read


def _other_layout(text: LogText, layout: CsvLayout, must_be_numeric: Callable[[int, str], bool]) -> TextLayout | None:
    """How a text is laid out that is a table in another way than this program's; None for any other."""
    head = _head_of(text)
    if _is_own(head, layout) or (_is_plain(head, layout, must_be_numeric) and not _names_again(text, layout)):
        return None
    return _layout_of(text, layout)


def _no_table(head: bytes, name_shown: str) -> str:
    """A message on a text that no mark cuts into columns of numbers: what stands in it, and what to do."""
    lines = lines_of(head.decode("utf-8", "replace"), _LOOKED_AT_ROWS)
    at, first = next((at, line.strip()) for at, line in enumerate(lines, 1) if line.strip())
    return (
        f"{name_shown}: none of its first lines is a row of numbers (line {at}: {first[:_SHOWN]!r}): messages, and no "
        "table. A log has a row for each sample, with its time, speed and current; where a table begins further down, "
        "`skip_rows` in a map says so (--columns)"
    )


def _layout_of(text: LogText, layout: CsvLayout) -> TextLayout | None:
    """How a text is laid out as its head shows; None where it is no table."""
    reported = {"delimiter": layout.delimiter, "decimal": layout.decimal, "encoding": layout.encoding}
    found = layout_of(_head_of(text), skip_rows=layout.skip_rows, **reported)
    return replace(found, names=()) if found is not None and layout.header is False else found


def _head_of(text: LogText) -> bytes:
    with text.open() as stream:
        return stream.read(_LOOKED_AT_BYTES)


def _begins_with_numbers(table: RawTable) -> bool:
    """Whether a column of words in a foreign table begins as one of numbers: what comes later is spelt otherwise."""
    words = [number for number in range(len(table.names)) if table.is_text(number)]
    begun = [[str(cell) for cell in table.columns[number].slice(0, _LEAST_ROWS).to_pylist()] for number in words]
    numbers = (cells for cells in begun if all(number_or_none(cell) is not None and cell.strip() for cell in cells))
    return any(numbers) and not _has_own_names(table)


def _holds_infinity(table: RawTable) -> bool:
    """Whether a number of a foreign table is infinite, as what is over a range is written."""
    foreign = not _has_own_names(table)
    return foreign and any(bool(np.isinf(table.numbers(number)).any()) for number in range(len(table.names)))


def _has_own_names(table: RawTable) -> bool:
    return "time_s" in table.names and bool({"speed_rad_s", "speed_rpm"} & {*table.names})


def _is_own(head: bytes, layout: CsvLayout) -> bool:
    """Whether a text begins with names of a log's own, between commas."""
    first = re.split(rb"[\r\n]", head.lstrip(b"\xef\xbb\xbf \t\r\n"), maxsplit=1)[0]
    names = {name.strip().strip('"') for name in first.decode("utf-8", "replace").split(",")}
    own = "time_s" in names and bool({"speed_rad_s", "speed_rpm"} & names)
    return own and layout.delimiter in (None, ",") and layout == CsvLayout(layout.delimiter, header=layout.header)


def _names_again(text: LogText, layout: CsvLayout) -> bool:
    """Whether the row of names stands in the text again, as where runs were put together, or words below the rows."""
    with text.open() as stream:
        for _ in range(layout.skip_rows):
            stream.readline()
        names = stream.readline()
        if layout.header is False or len(names) <= _A_NAME:
            return False
        seen = b"\n"
        while piece := stream.read(_BLOCK_BYTES):  # the text may be larger than the memory
            if b"\n" + names in (seen := seen + piece):
                return True
            seen = seen[-max(len(names) + 1, _LAST_BYTES) :]
    last = seen.rstrip().rsplit(b"\n", 1)[-1]
    mark = layout.separator.encode()
    return last.count(mark) < names.count(mark) and _SOME_WORDS.search(last) is not None


def _is_plain(head: bytes, layout: CsvLayout, must_be_numeric: Callable[[int, str], bool]) -> bool:
    """Whether a text is in this program's own way as far as its head shows, or is none that another would mend."""
    if layout.encoding is not None or layout.decimal is not None or layout.delimiter == BLANKS:
        return False
    text = head.decode("utf-8-sig", "replace")
    if "\0" in text[:4096]:
        return encoding_of(head) == "utf-8-sig"
    begun = lines_of(text, layout.skip_rows + _LOOKED_AT_ROWS)[layout.skip_rows :]
    lines = [line for line in begun if line.strip()]
    if not lines:
        return True
    try:
        rows = list(csv.reader(lines, delimiter=layout.separator))
    except csv.Error:
        return True
    if encoding_of(head) != "utf-8-sig":
        return False
    if stamped_form(lines).stamped or has_units(lines) or (not text.isascii() and _MINUS_CELL.search(text)):
        return False
    names = [name.strip() for name in rows[0]]
    numeric = [must_be_numeric(index, name) for index, name in enumerate(names)]
    whole = all(len(row) == len(names) for row in rows[1:-1] or rows)
    sound = len(names) > 1 and whole and not any(name.startswith(("#", "%", "//")) for name in names)
    cells = [
        cell for row in rows[1:-1] for cell, needed in zip(row, numeric, strict=False) if needed or not any(numeric)
    ]
    described = any(numeric) and not "".join(itertools.compress(rows[min(1, len(rows) - 1)], numeric)).strip()
    return sound and not described and all(number_or_none(cell) is not None or is_stamp(cell.strip()) for cell in cells)


def _read_plain(
    text: LogText, layout: CsvLayout, must_be_numeric: Callable[[int, str], bool], name_shown: str
) -> RawTable:
    file = _file_of(text, layout, must_be_numeric, name_shown)
    table = _fast(file)
    if table is None:
        read = read_slowly(file, name_shown)
    elif table.num_rows == 0:
        raise EmptyLogError(
            f"{name_shown}: {'has a header but no rows' if file.has_header else 'has no rows'}: nothing was logged"
        )
    else:
        read = RawTable(name_shown, file.names, list(table.columns), table.num_rows, place_finder(file))
    if text.torn is not None:
        read.warnings.append(
            f"{name_shown}: is a damaged or incomplete compressed file ({text.torn}); the {read.rows} rows before that "
            "were read"
        )
    return read


def _file_of(text: LogText, layout: CsvLayout, must_be_numeric: Callable[[int, str], bool], name_shown: str) -> CsvFile:
    """A file whose header has been read; a column that begins with a stamp need not hold numbers."""
    names, has_header, first_line, first_row = _header(text, layout, name_shown)
    stamps = _stamps(first_row, layout, len(names))
    numeric = tuple(must_be_numeric(i, name) and not stamps[i] for i, name in enumerate(names))
    return CsvFile(text, layout, names, has_header, first_line, numeric)


def _fast(file: CsvFile) -> pa.Table | None:
    """Let pyarrow read the file; None where it stumbles, for whatever reason."""
    import pyarrow as pa
    import pyarrow.csv as pa_csv

    try:
        with file.text.for_arrow() as text:
            table = pa_csv.read_csv(text, *_arrow_options(file, _BLOCK_BYTES))
    except (pa.ArrowException, OSError, ValueError):
        return None
    # Text that is not UTF-8 comes back as bytes: let the slow pass say where it is.
    return None if any(pa.types.is_binary(field.type) for field in table.schema) else table


def _arrow_options(file: CsvFile, block_bytes: int, *, guessing: bool = True) -> tuple[Any, Any, Any]:
    """How pyarrow is to read, to split and to convert.

    guessing: what columns hold that need not be numbers, as it guesses from the first block; else they are text.
    """
    import pyarrow as pa
    import pyarrow.csv as pa_csv

    keys = [str(index) for index in range(len(file.names))]  # positions: names may repeat, or have blanks around
    kinds = [pa.float64() if numeric else pa.string() for numeric in file.numeric]
    types = {key: kind for key, kind in zip(keys, kinds, strict=True) if not guessing or kind == pa.float64()}
    return (
        pa_csv.ReadOptions(skip_rows=file.first_line - 1, column_names=keys, block_size=block_bytes),
        pa_csv.ParseOptions(delimiter=file.layout.separator),
        pa_csv.ConvertOptions(column_types=types, null_values=_GAPS),
    )


def csv_in_parts(
    text: LogText,
    layout: CsvLayout,
    must_be_numeric: Callable[[int, str], bool],
    name_shown: str,
    *,
    with_others: bool,
) -> InParts | None:
    """The rows of a text, some ten thousand at a time; None for one that is laid out in another way.

    with_others: columns that need not be numbers are what their first values are; else they are text.
    """
    if _other_layout(text, layout, must_be_numeric) is not None:
        return None
    head, file = _head_of(text), _file_of(text, layout, must_be_numeric, name_shown)
    size, a_row = text.path.stat().st_size, len(head) / max(head.count(b"\n") - file.first_line + 1, 1)
    block = min(int(_ROWS_AT_ONCE * a_row), _MOST_BLOCK_BYTES)
    return InParts(int(size / a_row), file.names, lambda: _tables(file, name_shown, block, with_others))


def _tables(file: CsvFile, name_shown: str, block_bytes: int, with_others: bool) -> Iterator[RawTable]:
    """The tables of a file, block by block. Raises UnsoundError where pyarrow stumbles."""
    import pyarrow as pa
    import pyarrow.csv as pa_csv

    read, parse, convert = _arrow_options(file, block_bytes, guessing=with_others)
    place, first = place_finder(file), 0
    try:
        with file.text.for_arrow() as text, pa_csv.open_csv(text, read, parse, convert) as reader:
            for batch in reader:
                if batch.num_rows:
                    columns = [pa.chunked_array([column]) for column in batch.columns]
                    yield RawTable(name_shown, file.names, columns, batch.num_rows, partial(_place, place, first))
                    first += batch.num_rows
    except (pa.ArrowException, OSError, ValueError) as error:
        raise UnsoundError(str(error)) from None


def _place(place: Callable[[int], str], first: int, row: int) -> str:
    return place(first + row)


def _stamps(first_row: str, layout: CsvLayout, columns: int) -> list[bool]:
    """Of each column, whether its first cell is a date or a time of day."""
    try:
        cells = next(csv.reader([first_row], delimiter=layout.separator), [])
    except csv.Error:  # the slow pass will say where
        cells = []
    return [is_stamp(cell.strip()) for cell in cells[:columns]] + [False] * (columns - len(cells))


def _header(source: LogText, layout: CsvLayout, name: str) -> tuple[tuple[str, ...], bool, int, str]:
    """Names, whether a header row has them, the physical line (from 1) where the data start, and the first of them."""
    with source.open() as stream:
        head = stream.read(HEAD_BYTES)
    text = _decoded(head, name)
    lines = lines_of(text)  # as the readers of the rest do; splitlines() knows more line ends
    number = layout.skip_rows
    while number < len(lines) and not lines[number].strip():
        number += 1
    if number >= len(lines):
        skipped = f" after the {layout.skip_rows} skipped rows" if layout.skip_rows else ""
        raise EmptyLogError(f"{name}: the file is empty{skipped}: there is no header and no row")
    try:
        cells = next(csv.reader(io.StringIO(lines[number]), delimiter=layout.separator))
    except csv.Error as error:
        raise LogError(f"{name}: line {number + 1}: the header cannot be read ({error})") from None
    has_header = layout.header
    if has_header is None:
        has_header = not all(number_or_none(cell) is not None or is_stamp(cell.strip()) for cell in cells)
    first_line = number + (2 if has_header else 1)
    first_row = next((line for line in lines[first_line - 1 :] if line.strip()), "")
    return tuple(cell.strip() if has_header else "" for cell in cells), has_header, first_line, first_row


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
