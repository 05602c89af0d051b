"""A file that is read in parts, as it may be larger than the memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from rw_ekf.logs.raw_table import RawTable


class UnsoundError(Exception):
    """A file that cannot be read in parts: read as a whole it says what is wrong with it, or it is mended."""


class InParts(NamedTuple):
    """A file that can be read in parts, one table after the other, as often as it takes."""

    rows: int  # about
    names: tuple[str, ...]  # of its columns
    tables: Callable[
        [], Iterator[RawTable]
    ]  # `place` counts rows from the file's beginning. Raises UnsoundError, LogError
