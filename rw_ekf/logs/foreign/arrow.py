"""Arrow IPC files (Feather) and streams."""

from __future__ import annotations

from pathlib import Path

from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.format_library import foreign_format
from rw_ekf.logs.parquet_table import of_arrow
from rw_ekf.logs.raw_table import RawTable

_FILE, _STREAM = b"ARROW1", b"\xff\xff\xff\xff"


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """All batches under each other. Raises EmptyLogError for none."""
    from pyarrow import ipc

    with path.open("rb") as stream:
        is_file = stream.read(len(_FILE)) == _FILE
        stream.seek(0)
        table = (ipc.open_file if is_file else ipc.open_stream)(stream).read_all()
    table.validate(full=True)  # arrow believes offsets and lengths in a file unless it is called to check them
    return of_arrow(table, name)


FORMAT = foreign_format(
    "an Arrow (Feather) file",
    lambda head, suffix: head.startswith((_FILE, _STREAM)),
    "the first bytes of Arrow IPC",
    _read,
    otherwise="save it as Parquet or CSV",
)
