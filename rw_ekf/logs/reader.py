"""Reads a log of any kind: `read_log`. The content decides what a file is; the rules of docs/logs.md are applied here.

detect -> RawTable -> map_columns -> order of rows -> decimation -> derived speed -> current that drives -> WheelLog
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.checking.paths import path_of
from rw_ekf.errors import EmptyLogError, LogError
from rw_ekf.logs.assembly import Assembly
from rw_ekf.logs.checksums import all_sums, part_key, sums_of
from rw_ekf.logs.clock_columns import with_clock_columns, with_whole_time
from rw_ekf.logs.column_guess import needs_guess
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.formats import format_of
from rw_ekf.logs.interleaved import named_between, widened
from rw_ekf.logs.map_text import UncertainColumnsError, guessed_map
from rw_ekf.logs.part_compression import packed_path
from rw_ekf.logs.parts import FORMS, PartName, parts_of
from rw_ekf.logs.raw_table import RawTable, number_or_none, stacked
from rw_ekf.logs.side_by_side import beside_each_other, in_turn, without_empty_rows
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.logs.which_wheel import rows_of_wheel

if TYPE_CHECKING:
    from zoneinfo import ZoneInfo

# What stands in for the command's options where a table in memory is read.
_ANSWER = re.compile(r"--set ([\w.]+)=([^\s,;]*[^\s,;.])")
_IN_PYTHON = {
    "`rw-ekf columns table --out map.yaml` writes": "`rw_ekf.guess_columns` of it makes",
    "`rw-ekf columns` writes that down": "`rw_ekf.guess_columns` of it writes that down",
    "its --set answers": 'its arguments answer, as current__unit="mA"',
    "--columns map.yaml": "`columns` of `rw_ekf.read`",
    "--columns": "`columns` of `rw_ekf.read`",
}


def read_log(path: str | Path, columns: ColumnMap | str | Path | None = None, zone: ZoneInfo | None = None) -> WheelLog:
    """Read one log: CSV, Parquet or MATLAB, distinguished by content; CSV may be compressed with gzip or zstd.

    STEM.csv stands for all the parts of a run, which are read as if they were one file (docs/logs.md).
    columns: the column map of a foreign log, or the path of one. zone: of dates that bear none; None: UTC.
    Raises LogError (file, line, column, what to do) if the log cannot be used, ConfigError if the map is wrong.
    A log of one row, or without a single speed, is an error only for who needs more: it is read, with a warning.
    """
    column_map = map_of(columns)
    table = read_table(path_of(path, "a log"), column_map)
    table.zone = zone
    return _log_of_any(table, column_map)


def read_columns(source: Any, columns: ColumnMap | str | Path | None = None, zone: ZoneInfo | None = None) -> WheelLog:
    """A log of a table in memory: pandas, polars, arrow, or a mapping of names to arrays. Raises LogError."""
    table, column_map = table_in_memory(source), map_of(columns)
    table.zone = zone
    with _worded_for_python():
        log = _log_of_any(table, column_map)
    return replace(log, warnings=tuple(map(_in_python, log.warnings)))


@contextmanager
def _worded_for_python() -> Iterator[None]:
    try:
        yield
    except LogError as error:
        raise LogError(_in_python(str(error))) from None


def _in_python(text: str) -> str:
    """A sentence that speaks of the command's options, of arguments: no command reads a table in memory."""
    text = _ANSWER.sub(lambda found: f'{found[1].replace(".", "__")}="{found[2]}"', text)
    for option, argument in _IN_PYTHON.items():
        text = text.replace(option, argument)
    return text


def table_in_memory(source: Any, name: str = "table") -> RawTable:
    """A table of pandas, polars or arrow, or a mapping of names to arrays, as it is. Raises LogError."""
    import pyarrow as pa

    if isinstance(source, Mapping):
        return _table_of(source, name)
    try:
        table = pa.table(source)
    except (TypeError, ValueError, pa.ArrowException) as error:
        _refuse_repeated(list(map(str, getattr(source, "columns", ()))), name)
        raise LogError(
            f"a log is a path, a table or a mapping of names to arrays; found {type(source).__name__} ({error})"
        ) from None
    _refuse_repeated(table.column_names, name)
    return _table_of(dict(zip(table.column_names, table.columns, strict=True)), name)


def _refuse_repeated(names: list[str], table: str) -> None:
    repeated = next((name for name in names if names.count(name) > 1), None)
    if repeated is not None:
        raise LogError(f"{table}: {names.count(repeated)} columns are called {repeated!r}: rename all but one")


def map_of(columns: ColumnMap | str | Path | None) -> ColumnMap:
    """A column map, or the one at a path; that of a log's own names for none. Raises ConfigError."""
    if isinstance(columns, ColumnMap):
        return columns
    if not columns:
        return ColumnMap()
    from rw_ekf.logs.column_map_file import load_column_map

    return load_column_map(path_of(columns, "a column map"))


def _log_of_any(table: RawTable, column_map: ColumnMap) -> WheelLog:
    if column_map.wheel is not None and not table.one_wheel:
        table = rows_of_wheel(table, column_map.wheel)
    if not column_map.sources and column_map.rate_hz is None and needs_guess(table.names):
        try:
            column_map = guessed_map(table, column_map)
        except UncertainColumnsError as requested:
            map_of_it = f"`rw-ekf columns {table.path} --out map.yaml` writes"
            if requested.known:
                text = f"{table.path}: {requested} Known is {requested.known}; columns: {table.described_columns()}"
                raise LogError(
                    f"{text}. {map_of_it} the map that asks this, for --columns map.yaml; its --set answers"
                ) from None
            try:
                return log_of_table(table, column_map)
            except LogError as error:
                raise LogError(f"{error}; {map_of_it} one and asks: {requested}") from None
    return log_of_table(table, column_map)


def log_of_table(table: RawTable, columns: ColumnMap) -> WheelLog:
    """A log of a table that has been read. Raises LogError as `read_log`."""
    if columns.only is not None:
        table = table.of_only(*columns.only)
    if columns.reverse:
        table = table.reversed()
    return Assembly(columns).whole(table)


def log_of_arrays(columns: Mapping[str, Any], name: str, zone: ZoneInfo | None = None) -> WheelLog:
    """A log of columns in memory (name -> n values) of a log's own names. Raises LogError as `read_log`."""
    table = _table_of(columns, str(name))
    table.zone = zone
    with _worded_for_python():
        return log_of_table(table, ColumnMap())


def _table_of(columns: Mapping[str, Any], name: str) -> RawTable:
    held = {str(key): _column_of(values, f"{name}: column {str(key)!r}") for key, values in columns.items()}
    sizes = {key: len(values) for key, values in held.items()}
    if len(set(sizes.values())) > 1:
        raise LogError(f"{name}: the columns are of unequal length ({sizes}): a log has a value, or NaN, in each row")
    rows = next(iter(sizes.values()), 0)
    if rows == 0:
        raise EmptyLogError(f"{name}: has no rows: nothing was logged")
    return RawTable(name, tuple(held), list(held.values()), rows, lambda row: f"row {row + 1}")


def _column_of(values: Any, place: str) -> Any:
    """A column in memory: numbers as they are, masked ones missing; words and dates as arrow has them.

    Raises LogError for what is no column: `place` says which.
    """
    if hasattr(values, "to_pylist"):  # arrow's
        return _numbers_of_words(values)
    if not hasattr(values, "__len__") and hasattr(values, "__iter__") and not hasattr(values, "ndim"):
        values = list(values)
    wanted = "a log has one number, or NaN, in each row"
    try:
        array, mask = np.asarray(values), np.ma.getmaskarray(values) if np.ma.isMaskedArray(values) else None
    except ValueError:  # rows of unequal length
        raise LogError(f"{place} has several values in a row: {wanted}; give each its own name") from None
    if array.ndim == 0:
        raise LogError(f"{place} is {type(values).__name__} {str(values)[:40]!r}, no sequence of values: {wanted}")
    if array.size != len(array):
        advice = "transpose it" if array.size == max(array.shape) else "give each its own name"
        raise LogError(f"{place} has the shape {array.shape}: {wanted}; {advice}")
    if array.dtype.kind == "c":
        raise LogError(f"{place} holds complex numbers: {wanted}; give the real part, if that is meant")
    array, mask = array.reshape(-1), None if mask is None else mask.reshape(-1)
    if array.dtype.kind in "iuf" or (array.dtype.kind == "b" and mask is None):
        return array if mask is None else np.where(mask, np.nan, array)
    import pyarrow as pa

    try:
        return _numbers_of_words(pa.array(array, mask=mask))
    except (pa.ArrowException, TypeError, ValueError):
        raise LogError(f"{place} holds what is neither a number, a word nor a date, such as {array[0]!r}") from None


def _numbers_of_words(column: Any) -> Any:
    """A column of arrow's; words that all are numbers or empty are numbers, as they are in a CSV."""
    import pyarrow as pa

    if not (pa.types.is_string(column.type) or pa.types.is_large_string(column.type)):
        return column
    numbers = []
    for cell in column.to_pylist():
        numbers.append(number := number_or_none(cell or ""))
        if number is None:
            return column
    found = np.array(numbers, dtype=np.float64)
    return column if np.isnan(found).all() else found


def read_table(path: Path, columns: ColumnMap) -> RawTable:
    """Read the rows as they are, of every part. Raises LogError if a file is none of the known kinds or damaged.

    Where rows are missing between two parts, for a part that is not there or torn, that is reported, and the next one
    begins a segment of its own.
    """
    parts = parts_of(path)
    if len(parts.files) == 1 and PartName.of(parts.files[0].name) is None:
        table = _read_part(parts.files[0], columns)
        table.warnings += parts.warnings
        return table
    missing = missing_parts(path, parts.files)
    tables: list[RawTable] = []
    warnings, empty = [*parts.warnings, *missing.values()], None
    gaps, before = 0, 0
    broken = False
    for file in parts.files:
        number = _number_of(file)
        broken = broken or (before > 0 and number > before + 1)
        before = number
        try:
            table = _read_part(file, columns)
        except EmptyLogError as error:  # a part that was begun and no more, or is torn from its beginning
            empty, broken = error, True
            if file != parts.files[-1] or sums_of(file).rows or file.suffix != ".csv":
                warnings.append(f"{error}: what that part of the run held is missing{_rows(sums_of(file).rows)}")
            continue
        if broken and tables:
            gaps += 1
        table.begin_segment(gaps)
        broken = table.torn
        tables.append(table)
    if empty is not None and not tables:
        raise empty
    table = tables[0] if len(parts.files) == 1 else stacked(tables, str(path))
    table.warnings += warnings
    return table


def missing_parts(path: Path, files: tuple[Path, ...]) -> dict[int, str]:
    """Say which parts of the run are not there, by their number: gaps in the numbers, and those known by checksums."""
    requested = PartName.of(path.name)
    if requested is None or requested.form != FORMS[0] or requested.number > 1 or not files[0].exists():
        return {}
    found = {_number_of(file) for file in files}
    known = all_sums(path)
    rows = {number: known.get(part_key(number, estimates=requested.estimates)) for number in range(1, max(found) + 1)}
    number = max(found) + 1
    while (later := known.get(part_key(number, estimates=requested.estimates))) is not None:
        rows[number] = later
        number += 1
    return {
        number: f"{path}: part {number} of the run is not there: what it held is missing"
        f"{_rows(0 if sums is None else sums.rows)}"
        for number, sums in rows.items()
        if number not in found
    }


def _number_of(file: Path) -> int:
    part = PartName.of(file.name)
    return 1 if part is None else part.number


def _rows(number: int) -> str:
    return f" ({number} rows)" if number else ""


def _read_part(file: Path, columns: ColumnMap) -> RawTable:
    """Read a file, or what it has become if the daemon compressed it just now."""
    try:
        return _read_file(file, columns)
    except (LogError, FileNotFoundError):  # gone before it was opened, or after
        packed = packed_path(file)
        if file.exists() or not packed.exists():
            raise
        return _read_file(packed, columns)


def _read_file(path: Path, columns: ColumnMap) -> RawTable:
    name = str(path)
    table = format_of(path, name).read(path, name, columns)
    return table if not needs_guess(table.names) else in_rows(table)


def in_rows(table: RawTable) -> RawTable:
    """A foreign table with a row for each time, and each time in one column: itself where it is so already."""
    table = with_clock_columns(without_empty_rows(named_between(table) or table))
    return with_whole_time(widened(table) or beside_each_other(table) or in_turn(table) or table)
