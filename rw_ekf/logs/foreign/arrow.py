"""Arrow IPC files (Feather) and streams."""

from __future__ import annotations

from pathlib import Path

from rw_ekf.errors import EmptyLogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.guard import foreign_format
from rw_ekf.logs.parquet_table import units_in
from rw_ekf.logs.raw_table import RawTable

_FILE, _STREAM = b"ARROW1", b"\xff\xff\xff\xff"


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """All batches under each other. Raises EmptyLogError for none."""
    from pyarrow import ipc

    with path.open("rb") as stream:
        is_file = stream.read(len(_FILE)) == _FILE
        stream.seek(0)
        table = (ipc.open_file if is_file else ipc.open_stream)(stream).read_all()
    table.validate(full=True)  # arrow believes offsets and lengths in a file unless it is asked to look at them
    if table.num_rows == 0:
        raise EmptyLogError(f"{name}: has columns but no rows: nothing was logged")
    names = tuple(str(column).strip() for column in table.column_names)
    held = list(table.columns)
    return RawTable(name, names, held, table.num_rows, lambda row: f"row {row + 1}", units=units_in(table.schema))


FORMAT = foreign_format(
    "an Arrow (Feather) file",
    lambda head, suffix: head.startswith((_FILE, _STREAM)),
    "the first bytes of Arrow IPC",
    _read,
    otherwise="save it as Parquet or CSV",
)
