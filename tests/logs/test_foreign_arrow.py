"""Arrow files and streams are read."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pytest
from pyarrow import ipc, parquet

import rw_ekf
from tests.foreign_logs import Record, assert_same, assert_survives_damage, read_with, refusal

MAP = ("time_s: t", "speed_rad_s: w", "current_A: i")


@pytest.mark.parametrize("form", [ipc.new_file, ipc.new_stream])
@pytest.mark.parametrize("compression", [None, "zstd"])
def test_round_trip_and_damage(tmp_path: Path, form: object, compression: str | None) -> None:
    """A file and a stream of two batches read back, and neither ends the process when it is damaged."""
    record = Record(1)
    table = pa.table({"t": record.time_s, "w": record.speed, "i": record.current, "note": ["x"] * 60})
    path = tmp_path / "a.feather"
    with form(path, table.schema, options=ipc.IpcWriteOptions(compression=compression)) as writer:  # type: ignore[operator]
        writer.write_table(table, max_chunksize=40)
    log = read_with(path, *MAP)
    assert_same(log, record)
    assert log.other["note"].to_pylist() == ["x"] * 60
    assert_survives_damage(path, *MAP)


def test_structs_are_read_by_their_path_and_lists_are_nobody_s(tmp_path: Path) -> None:
    """`motor.speed_rpm` of a struct is a column; a list, be it called `wheel`, ends in no traceback."""
    record = Record(2)
    motor = pa.StructArray.from_arrays([pa.array(record.speed), pa.array(record.current)], names=["w_rad_s", "i_A"])
    table = pa.table({"t_s": record.time_s, "motor": motor, "wheel": [[1.0, 2.0]] * 60})
    parquet.write_table(table, tmp_path / "a.parquet")
    assert_same(rw_ekf.read(tmp_path / "a.parquet"), record)


def test_no_rows(tmp_path: Path) -> None:
    """An empty table says so."""
    path = tmp_path / "a.arrow"
    table = pa.table({"t": pa.array([], type=pa.float64())})
    with ipc.new_file(path, table.schema) as writer:
        writer.write_table(table)
    assert "has columns but no rows" in refusal(path, *MAP)
