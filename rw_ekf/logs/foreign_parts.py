"""A foreign table that is too long to be held: its columns are guessed from its first rows, and checked further on.

Of a table that has a row for each time and is in no need of questions. Each time as many rows have been read as before,
the rows that come are examined for what the columns are; where they do not say the same, the table is read as a whole.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from rw_ekf.errors import LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.in_parts import InParts, UnsoundError
from rw_ekf.logs.map_text import UncertainColumnsError, guessed_map
from rw_ekf.logs.raw_table import RawTable, stacked
from rw_ekf.logs.reader import in_rows


@dataclass(frozen=True)
class ForeignParts:
    """A foreign file in parts: the map that its first rows give, and its tables as long as they say the same."""

    file: InParts  # with all of its columns, as their first values are
    columns: ColumnMap
    warnings: tuple[str, ...]
    first_rows: int  # that the map was found from

    @classmethod
    def of(cls, file: InParts, given: ColumnMap, rows: int) -> ForeignParts | None:
        """Found from so many of its rows; None for a table that has to be seen as a whole. given: without columns."""
        try:
            head = _head(file, rows)
            columns = _map_of(head, given)
        except (LogError, UncertainColumnsError, UnsoundError):
            return None
        return None if columns is None else cls(file, columns, tuple(head.warnings), head.rows)

    def tables(self) -> Iterator[RawTable]:
        """Raises UnsoundError where later rows say otherwise what the columns are."""
        row, ask_again = 0, self.first_rows
        for table in self.file.tables():
            if row >= ask_again:
                ask_again = 2 * row
                self._ask(table)
            row += table.rows
            yield table

    def _ask(self, table: RawTable) -> None:
        try:
            found = _map_of(replace(table, warnings=[]), replace(self.columns, sources={}))
        except (LogError, UncertainColumnsError):
            found = None
        if found is None or found != self.columns:
            raise UnsoundError(f"{table.path}: later rows say otherwise what its columns are")


def _head(file: InParts, rows: int) -> RawTable:
    tables: list[RawTable] = []
    for table in file.tables():
        tables.append(table)
        if sum(each.rows for each in tables) >= rows:
            break
    return stacked(tables, tables[0].path)


def _map_of(table: RawTable, given: ColumnMap) -> ColumnMap | None:
    """The map of a table; None where its rows have to be turned or joined first. Raises UncertainColumnsError."""
    return guessed_map(table, given) if in_rows(table) is table else None
