"""What Arrow reads from belongs to none of Python's threads."""

from __future__ import annotations

import gzip
import os
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv as pa_csv
import pytest
from pyarrow import parquet

from rw_ekf.logs import long_log
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.native_file import native_file
from rw_ekf.logs.reader import read_log

ROWS = "time_s,speed_rpm,current_A\n" + "".join(f"{i / 10},{i % 70},.1\n" for i in range(200))


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz", "a.parquet"])
def test_arrow_is_given_no_object_of_pythons_to_read_from(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Proves that a log is read from files of Arrow's own: of Python's, a thread could be ended with the process."""
    path, sources = tmp_path / name, list[Any]()
    if name == "a.parquet":
        table = pa_csv.read_csv(pa.BufferReader(ROWS.encode()))
        parquet.write_table(table, path)
    else:
        path.write_bytes(gzip.compress(ROWS.encode()) if name.endswith(".gz") else ROWS.encode())

    def noting(read: Any) -> Any:
        def noted(source: Any, *rest: Any, **more: Any) -> Any:
            sources.append(source)
            return read(source, *rest, **more)

        return noted

    for module, function in ((pa_csv, "read_csv"), (pa_csv, "open_csv"), (parquet, "ParquetFile")):
        monkeypatch.setattr(module, function, noting(getattr(module, function)))
    assert len(read_log(path)) == 200
    whole = len(sources)
    monkeypatch.setattr(long_log, "LONG_ROWS", 100)
    in_parts = long_log.long_log_of(path, ColumnMap())
    assert in_parts is None if name.endswith(".gz") else in_parts is not None
    if in_parts is not None:
        assert sum(len(part.log) - part.begin for part in in_parts.parts()) == 200
        assert len(sources) > whole
    assert whole
    assert all(type(source) in (pa.OSFile, pa.BufferReader) for source in sources)


def test_a_file_whose_name_is_not_utf_8_is_the_one_that_is_read(tmp_path: Path) -> None:
    """Proves that a name Arrow has no words for leads to its file all the same, and a missing one to OSError."""
    try:
        (named := Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff.csv"))).write_text(ROWS)
    except OSError:
        pytest.skip("no such names on this file system")
    with native_file(named) as opened:
        assert opened.read() == ROWS.encode()
    assert len(read_log(named)) == 200
    with pytest.raises(OSError, match="nothing"):
        native_file(tmp_path / "nothing")
