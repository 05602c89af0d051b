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
    read = RawTable(name, names, held, table.num_rows, lambda row: f"row {row + 1}")
    read.units, read.remarks = units_in(table.schema), remarks_in(table.schema)
    return read


def units_in(schema: Any) -> dict[str, str]:
    """Units by name of column, where the fields of a schema have one as metadata."""
    found = {field.name.strip(): (field.metadata or {}) for field in schema}
    return {
        name: said.decode("utf-8", "replace")
        for name, metadata in found.items()
        for key, said in metadata.items()
        if key.lower() in (b"unit", b"units")
    }


def remarks_in(schema: Any) -> dict[str, str]:
    """What else the fields of a schema say as metadata, by name of column: `scale: 0.1`."""
    found = {}
    for field in schema:
        said = {
            key.decode("utf-8", "replace"): text.decode("utf-8", "replace")
            for key, text in (field.metadata or {}).items()
        }
        rest = [
            f"{key}: {text}" for key, text in said.items() if key.lower() not in ("unit", "units", "parquet:field_id")
        ]
        if rest:
            found[field.name.strip()] = "; ".join(rest)
    return found


FORMAT = LogFormat(
    lambda head, suffix: head.startswith(b"PAR1"),
    lambda path, name, columns: noting_suffix(read_parquet_table(path, name), path, ".parquet", "Parquet"),
    "the first bytes 'PAR1'",
)
