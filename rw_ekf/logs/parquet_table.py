"""Parquet files."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from rw_ekf.errors import EmptyLogError, LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.in_parts import InParts, UnsoundError
from rw_ekf.logs.labels import unit_and_remark
from rw_ekf.logs.log_columns import READABLE_COLUMNS
from rw_ekf.logs.log_format import LogFormat, noting_suffix
from rw_ekf.logs.native_file import native_file
from rw_ekf.logs.raw_table import RawTable

_ROWS_AT_ONCE = 1 << 15  # their columns and what a filter leaves of them fit into the processor's cache
_BUFFER_BYTES = 1 << 20  # of each column: a row group may be larger than the memory


def read_parquet_table(path: Path, name: str) -> RawTable:
    """Read a Parquet file. Raises LogError if it cannot be read or has no rows."""
    import pyarrow as pa
    from pyarrow import parquet

    try:
        # Opened by hand: a path would be searched for partitions (`key=value` directories) and gain columns.
        with native_file(path) as stream:
            table = parquet.ParquetFile(stream, page_checksum_verification=True).read()
    except (pa.ArrowException, OSError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise LogError(
            f"{name}: is a damaged or incomplete Parquet file ({reason}): write it again, or give the CSV"
        ) from None
    return of_arrow(table, name)


def of_arrow(table: Any, name: str) -> RawTable:
    """An arrow table with what its schema says of its columns. Raises EmptyLogError if it has no rows."""
    if table.num_rows == 0:
        raise EmptyLogError(f"{name}: has columns but no rows: nothing was logged")
    while any(_is_struct(field.type) for field in table.schema):  # `motor.speed_rpm`
        table = table.flatten()
    names = tuple(str(column).strip() for column in table.column_names)
    read = RawTable(name, names, list(table.columns), table.num_rows, lambda row: f"row {row + 1}")
    for column, field in zip(names, table.schema, strict=True):
        stated = {key.decode("utf-8", "replace"): value.decode("utf-8", "replace")
                for key, value in (field.metadata or {}).items() if key.lower() != b"parquet:field_id"}  # fmt: skip
        read.units[column], read.remarks[column] = unit_and_remark(stated)
    return read


def _is_struct(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_struct(kind))


def parquet_in_parts(path: Path, name: str, columns: ColumnMap, carried: Collection[str] | None) -> InParts | None:
    """The rows of a file, some ten thousand at a time."""
    import pyarrow as pa
    from pyarrow import parquet

    def opened(stream: pa.NativeFile) -> Any:
        return parquet.ParquetFile(stream, page_checksum_verification=True, buffer_size=_BUFFER_BYTES, pre_buffer=False)

    def tables() -> Iterator[RawTable]:
        first = 0
        try:
            with native_file(path) as stream:
                file = opened(stream)
                names = [
                    field.name
                    for field in file.schema_arrow
                    if _is_struct(field.type) or _is_read(field.name.strip(), columns, carried)
                ]
                for group in range(file.num_row_groups):  # one iterator over all would keep what each has used
                    for batch in file.iter_batches(_ROWS_AT_ONCE, row_groups=[group], columns=names, use_threads=False):
                        table = of_arrow(pa.Table.from_batches([batch]), name)
                        table.place = lambda row, first=first: f"row {first + row + 1}"  # type: ignore[misc]
                        yield noting_suffix(table, path, ".parquet", "Parquet")
                        first += batch.num_rows
        except (pa.ArrowException, OSError, ValueError) as error:
            raise UnsoundError(str(error)) from None

    try:
        with native_file(path) as stream:
            file = opened(stream)
            return InParts(int(file.metadata.num_rows), tuple(file.schema_arrow.names), tables)
    except (pa.ArrowException, OSError, ValueError):
        return None


def _is_read(column: str, columns: ColumnMap, carried: Collection[str] | None) -> bool:
    by_number = any(isinstance(source.column, int) for source in columns.sources.values())
    return by_number or carried is None or column in READABLE_COLUMNS or column in carried or columns.uses(-1, column)


FORMAT = LogFormat(
    lambda head, suffix: head.startswith(b"PAR1"),
    lambda path, name, columns: noting_suffix(read_parquet_table(path, name), path, ".parquet", "Parquet"),
    "the first bytes 'PAR1'",
    in_parts=parquet_in_parts,
)
