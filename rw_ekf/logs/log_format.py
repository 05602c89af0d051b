"""What a form of log files is: how it is recognised, and how read."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import NamedTuple

from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.in_parts import InParts
from rw_ekf.logs.raw_table import RawTable

HEAD_BYTES = 128


class LogFormat(NamedTuple):
    """One form of log files."""

    recognises: Callable[[bytes, str], bool]  # by the first HEAD_BYTES; by the suffix, in small letters, if at all
    read: Callable[[Path, str, ColumnMap], RawTable]  # str: stands for the file in messages. Raises LogError
    by: str = ""  # by what it is recognised, in words, for the list of formats
    extra: str = ""  # what `pip install "rw-ekf[EXTRA]"` brings to read it; empty: nothing more is needed
    modules: tuple[str, ...] = ()  # what that installs, as it is imported
    # In parts, with the columns of these names (None: all) beside the log's own; None where only a whole can be judged.
    in_parts: Callable[[Path, str, ColumnMap, Collection[str] | None], InParts | None] = lambda *_: None


def noting_suffix(table: RawTable, path: Path, suffix: str, kind: str) -> RawTable:
    """The table, with a warning where the file is called otherwise than files of its kind are."""
    if path.suffix.lower() != suffix:
        table.warnings.append(f"{table.path}: is a {kind} file in spite of its name, and was read as one")
    return table
