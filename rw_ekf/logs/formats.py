"""Which form a log file has, by its first bytes, for names lie; installed packages add forms (rw_ekf.log_formats).

`python -m rw_ekf.logs.formats` lists them.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from rw_ekf.errors import EmptyLogError, LogError, reason_of
from rw_ekf.logs.log_format import HEAD_BYTES, LogFormat
from rw_ekf.plugins import loaded_as, registered

_OWN = {
    "parquet": "rw_ekf.logs.parquet_table:FORMAT",
    "matlab": "rw_ekf.logs.matlab_table:FORMAT",
    "arrow": "rw_ekf.logs.foreign.arrow:FORMAT",
    "numpy": "rw_ekf.logs.foreign.numpy_arrays:FORMAT",
    "sheet": "rw_ekf.logs.foreign.sheets:FORMAT",
    "hdf5": "rw_ekf.logs.foreign.hdf5:FORMAT",
    "mdf": "rw_ekf.logs.foreign.mdf:FORMAT",
    "tdms": "rw_ekf.logs.foreign.tdms:FORMAT",
    "lvm": "rw_ekf.logs.foreign.lvm:FORMAT",
    "mcap": "rw_ekf.logs.foreign.mcap_log:FORMAT",
    "sqlite": "rw_ekf.logs.foreign.database:SQLITE",
    "sql": "rw_ekf.logs.foreign.database:FORMAT",
    "rosbag2": "rw_ekf.logs.foreign.rosbag:FORMAT",
    "rosbag1": "rw_ekf.logs.foreign.rosbag:ROS_1",
    "ulog": "rw_ekf.logs.foreign.ulog:FORMAT",
    "dataflash": "rw_ekf.logs.foreign.dataflash:FORMAT",
    "can": "rw_ekf.logs.foreign.can_log:FORMAT",
    "octave": "rw_ekf.logs.foreign.octave:FORMAT",
    "igor": "rw_ekf.logs.foreign.igor:FORMAT",
    "influx_csv": "rw_ekf.logs.foreign.influx_log:ANNOTATED",
    "influx": "rw_ekf.logs.foreign.influx_log:FORMAT",
    "json": "rw_ekf.logs.foreign.json_records:FORMAT",
    "yaml": "rw_ekf.logs.foreign.json_records:YAML",
    "csv": "rw_ekf.logs.csv_log:FORMAT",
}
_LAST = "csv"  # takes what nobody else takes
_FOREIGN: tuple[tuple[bytes | tuple[bytes, ...], str], ...] = (
    (b"BZh", "compressed with bzip2: unpack it first"),
    (b"\xfd7zXZ", "compressed with xz: unpack it first"),
    (b"PK\x03\x04", "a zip archive: unpack it first, or save the sheet as CSV if it is a spreadsheet"),
    (b"\xa3\x95\x80", "a binary DataFlash log of ArduPilot: write it as text, with mavlogdump.py"),
    (b"FEA1", "a Feather file of version 1: save it as Feather 2, Parquet or CSV"),
    (
        (b"\x80\x04\x95", b"\x80\x05\x95"),
        "a pickle of Python, which may run anything when it is opened: save the table as Parquet or CSV",
    ),
    (b"%PDF-", "a PDF, which has no numbers in columns: save the log itself"),
)
_MARKED = {  # how texts of elements begin, in whatever case
    "a web page": ((b"<!doctype html", b"<html", b"<table"), "read_html"),
    "XML": ((b"<?xml",), "read_xml"),
}


def format_of(path: Path, name: str) -> LogFormat:
    """The form of a file; `name` stands for it in messages. Raises LogError if it is none that can be read."""
    head, suffix = _head_of(path, name), path.suffix.lower()
    points = registered("rw_ekf.log_formats", _OWN)
    for key, point in points.items():
        form = loaded_as(LogFormat, point)
        if key != _LAST and form.recognises(head, suffix):
            return form
    for magic, what in _FOREIGN:
        if head.startswith(magic):
            raise LogError(f"{name}: is {what}")
    for what, (begins, reader) in _MARKED.items():
        if head.removeprefix(b"\xef\xbb\xbf").lstrip().lower().startswith(begins):
            raise LogError(f"{name}: is {what}: save its table as CSV, or hand over what pandas.{reader} makes of it")
    if suffix in (".parquet", ".mat"):
        kind = "Parquet" if suffix == ".parquet" else "MATLAB"
        raise LogError(
            f"{name}: is called {suffix} but is no {kind} file (it begins with {head[:8]!r}): rename it to what it is, "
            "or write it again"
        )
    return loaded_as(LogFormat, points[_LAST])


def _head_of(path: Path, name: str) -> bytes:
    """The first bytes of a file. Raises LogError where there is none to be read."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise LogError(f"{name}: is a device or pipe, which can be read only once: save the log to a file first")
    try:
        with path.open("rb") as stream:
            head = stream.read(HEAD_BYTES)
    except FileNotFoundError:
        raise LogError(f"{name}: no such file") from None
    except IsADirectoryError:
        raise LogError(f"{name}: is a directory: give the log file in it") from None
    except (OSError, ValueError) as error:
        raise LogError(f"{name}: cannot be read ({reason_of(error)})") from None
    if not head:
        raise EmptyLogError(f"{name}: the file is empty")
    return head


def listed() -> str:
    """A table of the forms in the order in which they are tried: name, how recognised, extra, installed or not."""
    rows = [("format", "recognised by", "extra", "installed")]
    for key, point in registered("rw_ekf.log_formats", _OWN).items():
        form = loaded_as(LogFormat, point)
        there = all(importlib.util.find_spec(module) is not None for module in form.modules)
        rows.append((key, form.by or "its own rule", form.extra or "-", "yes" if there else "no"))
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows)
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(listed())
