"""Parquet files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rw_ekf.errors import LogError
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
    if table.num_rows == 0:
        raise LogError(f"{name}: has columns but no rows: nothing was logged")
    names = tuple(str(column).strip() for column in table.column_names)
    held = list(table.columns)
    return RawTable(name, names, held, table.num_rows, lambda row: f"row {row + 1}", units=units_in(table.schema))


def units_in(schema: Any) -> dict[str, str]:
    """Units by name of column, where the fields of a schema have one as metadata."""
    found = {field.name.strip(): (field.metadata or {}) for field in schema}
    return {
        name: said.decode("utf-8", "replace")
        for name, metadata in found.items()
        for key, said in metadata.items()
        if key.lower() in (b"unit", b"units")
    }


FORMAT = LogFormat(
    lambda head, suffix: head.startswith(b"PAR1"),
    lambda path, name, columns: noting_suffix(read_parquet_table(path, name), path, ".parquet", "Parquet"),
    "the first bytes 'PAR1'",
)
