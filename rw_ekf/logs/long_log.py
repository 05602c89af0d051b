"""A log that is too long to be held: its parts, one after the other, as often as they are requested.

Each part begins with the last rows of the one before it, so that what came before a row is known there: the current
that was in force, and what a lag or a delay looks back on. The rows are those of the log read as a whole.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from rw_ekf.errors import EmptyLogError, LogError
from rw_ekf.logs.assembly import Assembly, Rows
from rw_ekf.logs.column_guess import needs_guess
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign_parts import ForeignParts
from rw_ekf.logs.formats import format_of
from rw_ekf.logs.in_parts import InParts, UnsoundError
from rw_ekf.logs.parts import parts_of
from rw_ekf.logs.raw_table import RawTable
from rw_ekf.logs.reader import missing_parts
from rw_ekf.logs.wheel_log import WheelLog

LONG_ROWS = 262_144  # 54 MB and more as a whole; shorter logs are held, and all that is known of a log is known of them
_LEAST_ROW_BYTES = 2.0  # of a file: a reading has noise, which nothing packs into less
_KEPT_BYTES = 96_000_000  # of parts, a million rows and more: to read them again costs as much as to filter them twice
BEFORE_S = 12.0  # of the part before: a delay or a mean is 10 s at most (rw_ekf.effects)


class LogPart(NamedTuple):
    """A part of a log."""

    log: WheelLog  # with rows of the part before in front
    begin: int  # how many these are
    first_row: int  # the number in the whole log of the row at `begin`


@dataclass(eq=False)
class LongLog:
    """A log in files that can be read in parts."""

    name: str
    columns: ColumnMap
    files: tuple[InParts, ...]
    carried: tuple[str, ...] | None = ()  # columns that a model is a function of; None: all there are
    rows: int = 0  # about, until all parts have been read once
    how_read: tuple[str, ...] = ()  # sentences on a foreign one
    warnings: tuple[str, ...] = field(default=(), init=False)  # these, and what was mended, once it has been read
    _kept: list[LogPart] | None = field(default=None, init=False)  # all of them, where they have been read and are few

    def __len__(self) -> int:
        return self.rows

    def parts(self, *, again: bool = False) -> Iterator[LogPart]:
        """Read the parts; again: they will be read once more, and those of a log that is not much too long are kept.

        Raises UnsoundError where only the whole can be judged, LogError as `read_log`.
        """
        if self._kept is not None:
            yield from self._kept
            return
        assembly, row, size = Assembly(self.columns, self.carried), 0, 0
        kept: list[LogPart] = []
        last: Rows | None = None
        for table in self._tables():
            log, begin, last = self._part(assembly, table, last)
            part = LogPart(log, begin, row)
            size += _bytes_of(log)
            again = again and size <= _KEPT_BYTES
            kept = [*kept, part] if again else []
            yield part
            row += len(log) - begin
        self.rows, self.warnings = row, (*self.how_read, *assembly.warnings(self.name))
        self._kept = kept if again else None

    def _part(self, assembly: Assembly, table: RawTable, last: Rows | None) -> tuple[WheelLog, int, Rows]:
        """A part, with the rows before it in front, and how many these are.

        Of columns that were guessed from the first rows nothing odd is taken: the whole may say what they are by it.
        """
        try:
            log, begin, rows = assembly.part(table, last, BEFORE_S)
        except LogError as error:
            if self.columns.guessed:
                raise UnsoundError(str(error)) from None
            raise
        if self.columns.guessed and assembly.tally.skipped:
            raise UnsoundError(f"{self.name}: its times do not rise from row to row")
        return log, begin, rows

    def _tables(self) -> Iterator[RawTable]:
        for file in self.files:
            for table in file.tables():
                table.path = self.name
                yield table


def _bytes_of(log: WheelLog) -> int:
    arrays = (log.time_s, log.speed_rad_s, log.current_A, log.command_delay_s, log.segment, *log.channels.values())
    return sum(array.nbytes for array in arrays) + sum(len(values) * 8 for values in log.other.values())


def long_log_of(path: Path, columns: ColumnMap, carried: tuple[str, ...] | None = ()) -> LongLog | None:
    """A log that can be read in parts, and is long enough for that; None for any other, whatever it is."""
    log = _of_map(path, columns, carried)
    if log is None or columns.sources or not any(needs_guess(file.names) for file in log.files):
        return log
    if len(log.files) > 1 or (whole := _of_map(path, columns, None)) is None:
        return None
    found = ForeignParts.of(whole.files[0], columns, LONG_ROWS)
    if found is None or not _row_by_row(found.columns):
        return None
    file = found.file._replace(tables=found.tables)
    return LongLog(log.name, found.columns, (file,), carried, log.rows, found.warnings)


def _of_map(path: Path, columns: ColumnMap, carried: tuple[str, ...] | None) -> LongLog | None:
    """The same, where its columns are as a map has them, or as a log's own names are."""
    if not _row_by_row(columns):
        return None
    parts = parts_of(path)
    if parts.warnings or _size_of(parts.files) < _LEAST_ROW_BYTES * LONG_ROWS or missing_parts(path, parts.files):
        return None
    files = []
    for file in parts.files:
        try:
            found = format_of(file, str(file)).in_parts(file, str(file), columns, carried)
        except (OSError, EmptyLogError):
            return None
        if found is None:
            return None
        files.append(found)
    rows = sum(file.rows for file in files)
    return LongLog(str(path), columns, tuple(files), carried, rows) if rows > LONG_ROWS else None


def _size_of(files: tuple[Path, ...]) -> int:
    """Bytes of all files; none of those that are not there, which whoever reads them says."""
    return sum(file.stat().st_size for file in files if file.is_file())


def _row_by_row(columns: ColumnMap) -> bool:
    """Whether a map says of each row what it is, whatever the others are."""
    path, sources, csv = columns.path, columns.sources, columns.csv
    plain = ColumnMap(path, sources, csv, repeats=columns.repeats, dbc=columns.dbc, guessed=columns.guessed)
    return (
        columns == plain
        and columns.repeats != "spread"
        and all(source.kind != "derivative" and source.sign_of is None for source in sources.values())
        and not any(source.wrap for name, source in sources.items() if name == "time_s")
    )
