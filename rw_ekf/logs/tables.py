"""Whole tables out: CSV, Parquet or MATLAB by suffix, all or nothing, every float exactly as it was."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from rw_ekf.errors import BadInputError
from rw_ekf.logs.atomic import atomic_path, is_special
from rw_ekf.logs.writer import cell

if TYPE_CHECKING:
    import pyarrow as pa

SUFFIXES = (".csv", ".parquet", ".mat")
_MATLAB_NAME = re.compile(r"[A-Za-z]\w{0,62}", re.ASCII)


def check_suffix(path: str | Path) -> None:
    """Raise BadInputError unless `path` ends in a suffix that `write_table` knows: before the work, not after it."""
    target = Path(path)
    if target.suffix.lower() not in SUFFIXES and not is_special(target):
        raise BadInputError(f"{path}: the name must end in {', '.join(SUFFIXES)}: that decides how it is written")


def write_table(path: str | Path, columns: Mapping[str, Any]) -> None:
    """Write columns (name -> n numbers, booleans or texts; numpy array, list or pyarrow array) as one table.

    NaN and None are gaps: empty in CSV, null in Parquet, NaN in MATLAB. A device such as /dev/stdout gets CSV.
    Raises BadInputError for an unknown suffix or a place that cannot be written, ValueError for unequal lengths.
    """
    with table_writer(path) as write:
        write(columns)


@contextmanager
def table_writer(path: str | Path) -> Iterator[Callable[[Mapping[str, Any]], None]]:
    """Give what writes columns under those before, as `write_table` does; the file is there once the block ends well.

    MATLAB files alone are held until then. All columns have the names and kinds of the first; else BadInputError.
    """
    check_suffix(path)
    suffix = Path(path).suffix.lower()
    # Opened by hand: pyarrow takes a path for UTF-8, and would write to a file beside it where names are not.
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        sheet = _Sheet(stream, suffix, str(path))
        yield sheet.write
        sheet.close()


class _Sheet:
    """A table that is being written."""

    def __init__(self, stream: BinaryIO, suffix: str, name: str) -> None:
        self._stream, self._suffix, self._name = stream, suffix, name
        self._schema: pa.Schema | None = None
        self._parquet: Any = None
        self._held: list[pa.Table] = []

    def write(self, columns: Mapping[str, Any]) -> None:
        table = table_of(columns)
        first = self._schema is None
        self._schema = self._schema or table.schema
        if table.schema != self._schema:
            raise BadInputError(
                f"{self._name}: the tables to be written have other columns ({', '.join(table.column_names)}) than the "
                f"first ({', '.join(self._schema.names)}): write them one by one"
            )
        if self._suffix == ".mat":
            self._held.append(table)
        elif self._suffix != ".parquet":
            _write_csv(self._stream, table, header=first)
        else:
            from pyarrow import parquet

            # A dictionary of measured numbers is as long as they are: it would take twice the time and more room.
            self._parquet = self._parquet or parquet.ParquetWriter(
                self._stream, self._schema, use_dictionary=_texts(self._schema), write_page_checksum=True
            )
            self._parquet.write_table(table)

    def close(self) -> None:
        import pyarrow as pa

        if self._parquet is not None:
            self._parquet.close()
        if self._held:
            _write_matlab(self._stream, pa.concat_tables(self._held))


def _texts(schema: pa.Schema) -> list[str]:
    """Columns of words, of which there are few."""
    import pyarrow as pa

    return [field.name for field in schema if pa.types.is_string(field.type)]


def table_of(columns: Mapping[str, Any]) -> pa.Table:
    """Columns (name -> n values) as one table. Raises ValueError for unequal lengths."""
    import pyarrow as pa

    arrays = {}
    for name, values in columns.items():
        if isinstance(values, pa.Array | pa.ChunkedArray):
            arrays[name] = values
        else:
            arrays[name] = pa.array(values, from_pandas=True)  # NaN becomes a gap
    lengths = {name: len(array) for name, array in arrays.items()}
    if len(set(lengths.values())) > 1:
        raise ValueError(f"columns of unequal length: {lengths}")
    return pa.table(arrays)


def _write_csv(stream: BinaryIO, table: pa.Table, *, header: bool) -> None:
    import pyarrow as pa
    import pyarrow.csv as pa_csv

    table = pa.table({name: _written(column) for name, column in zip(table.column_names, table.columns, strict=True)})
    # Gaps in carried columns may stand as NaN, which readers take for a gap as well.
    if header:
        stream.write((",".join(map(cell, table.column_names)) + "\n").encode())
    pa_csv.write_csv(table, stream, pa_csv.WriteOptions(include_header=False, quoting_style="needed"))


def _written(column: Any) -> Any:
    """A column as CSV can hold it: lists and the like as text."""
    return column if not column.type.num_fields else [None if v is None else str(v) for v in column.to_pylist()]


def _write_matlab(stream: BinaryIO, table: pa.Table) -> None:
    from scipy.io import savemat

    content: dict[str, Any] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        content[_matlab_name(name, content)] = _matlab_values(column)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        savemat(stream, content, long_field_names=True, oned_as="column")


def _matlab_name(name: str, taken: Mapping[str, Any]) -> str:
    """Turn a column's name into one that MATLAB takes: other signs become `_`, a number is added where two coincide."""
    if not _MATLAB_NAME.fullmatch(name):
        name = re.sub(r"\W", "_", name, flags=re.ASCII)
        name = (name if name[:1].isalpha() else f"x{name}")[:63]
    result, number = name, 2
    while result in taken:
        result, number = f"{name[:59]}_{number}", number + 1
    return result


def _matlab_values(column: Any) -> Any:
    import pyarrow as pa

    kind = column.type
    if pa.types.is_boolean(kind):
        return np.array([np.nan if value is None else float(value) for value in column.to_pylist()])
    if pa.types.is_floating(kind) or pa.types.is_integer(kind):
        return np.array(column.to_numpy(), dtype=np.float64 if column.null_count else None)
    return np.array(["" if value is None else str(value) for value in column.to_pylist()], dtype=object)
