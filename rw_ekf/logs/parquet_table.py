"""Parquet files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rw_ekf.errors import EmptyLogError, LogError
from rw_ekf.logs.format import LogFormat, noting_suffix
from rw_ekf.logs.raw_table import RawTable


def read_parquet_table(path: Path, name: str) -> RawTable:
    """Read a Parquet file. Raises LogError if it cannot be read or has no rows."""
    import pyarrow as pa
    from pyarrow import parquet

    try:
        # Opened by hand: a path would be searched for partitions (`key=value` directories) and gain columns.
        with path.open("rb") as stream:
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
    names = tuple(str(column).strip() for column in table.column_names)
    read = RawTable(name, names, list(table.columns), table.num_rows, lambda row: f"row {row + 1}")
    for column, field in zip(names, table.schema, strict=True):
        remarks = []
        for said in (field.metadata or {}).items():
            key, text = (part.decode("utf-8", "replace") for part in said)
            if key.lower() in ("unit", "units"):
                read.units[column] = text
            elif key.lower() != "parquet:field_id":
                remarks.append(f"{key}: {text}")
        if remarks:
            read.remarks[column] = "; ".join(remarks)
    return read


FORMAT = LogFormat(
    lambda head, suffix: head.startswith(b"PAR1"),
    lambda path, name, columns: noting_suffix(read_parquet_table(path, name), path, ".parquet", "Parquet"),
    "the first bytes 'PAR1'",
)
