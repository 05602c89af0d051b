"""Settings beside the rows of a table, as oscilloscopes and sheets have them: cells of the first rows alone.

Record Length,600,,0.00,1203.1,0.251
Vertical Units,V,,0.01,1203.4,0.250
,,,0.02,1203.9,0.252
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from rw_ekf.logs.log_text import LogText
from rw_ekf.logs.text_cells import MARKS, TextLayout, split_cells
from rw_ekf.logs.text_layout import NEARLY_ALL, encoding_of, lines_of

_LOOKED_AT = 400  # rows
_MOST_SETTINGS = 60  # rows that have one
_LEAST_CORE = 2  # columns of numbers: a time and a signal


class Beside(NamedTuple):
    """Where the settings stand."""

    columns: frozenset[int]  # that hold nothing else
    last: int  # row, from 0, of the last of them
    core: tuple[int, ...]  # columns of which all rows of numbers have each one


def beside(rows: Sequence[Sequence[Any]], is_value: Callable[[Any], bool]) -> Beside | None:
    """Columns that only the first rows fill, beside numbers, words and their values; None where there are none.

    rows: cells, empty ones as "" or None.
    """
    rows = rows[:_LOOKED_AT]
    width = max(map(len, rows), default=0)
    filled = [[at for at, row in enumerate(rows) if _is_filled(row, c)] for c in range(width)]
    rest = range(min(_MOST_SETTINGS, len(rows) // 2), len(rows))
    aside = [c for c in range(width) if filled[c] and filled[c][-1] < rest.start]
    if not aside:
        return None
    need = NEARLY_ALL * len(rest)
    core = tuple(c for c in range(width) if sum(at in rest and is_value(rows[at][c]) for at in filled[c]) >= need > 0)
    if len(core) < _LEAST_CORE:
        return None
    data = {at for at in range(rest.start) if _has_all(rows[at], core, is_value)}
    words = {c for c in aside if sum(at in data and not is_value(rows[at][c]) for at in filled[c]) >= _LEAST_CORE}
    keys = words & {c - 1 for c in aside}  # whose values are the table's own are above it
    columns = frozenset(c for c in aside if c in keys or c - 1 in keys)
    inside = range(min(core), max(core))
    if not columns or any(c in inside for c in columns):
        return None
    return Beside(columns, max(at for c in columns for at in filled[c]), core)


def _is_filled(row: Sequence[Any], column: int) -> bool:
    return column < len(row) and row[column] not in ("", None)


def _has_all(row: Sequence[Any], core: Sequence[int], is_value: Callable[[Any], bool]) -> bool:
    return all(_is_filled(row, c) and is_value(row[c]) for c in core)


def reported(row: Sequence[Any], found: Beside) -> str:
    """What a row has beside its numbers, as a line of text; empty for nothing."""
    cells = [str(row[c]) for c in sorted(found.columns) if _is_filled(row, c)]
    return ": ".join(cells)


def without(row: Sequence[Any], found: Beside) -> list[Any]:
    """A row, its settings empty; what is no row of the numbers, nor of their names, stays as it is."""
    is_one = any(_is_filled(row, c) for c in found.core)
    return ["" if is_one and c in found.columns else cell for c, cell in enumerate(row)]


def parted(text: LogText, head: bytes, delimiter: str | None) -> tuple[bytes, tuple[str, ...]] | None:
    """A text without the settings beside its rows, line for line, and these as lines; None for one without any.

    head: its beginning.
    """
    encoding = encoding_of(head)
    begun = lines_of(head.decode(encoding, "replace"))[:_LOOKED_AT]
    for mark in (delimiter,) if delimiter else MARKS:
        if mark not in MARKS or sum(mark in line for line in begun) < NEARLY_ALL * len(begun):
            continue
        cells = [split_cells(line, mark) for line in begun]
        ways = (beside(cells, TextLayout(decimal=decimal).is_value) for decimal in ".,")
        found = max(filter(None, ways), key=lambda each: len(each.core), default=None)
        if found is None:
            continue
        with text.open() as stream:
            rows = [split_cells(line, mark) for line in lines_of(stream.read().decode(encoding, "replace"))]
        out = io.StringIO()
        csv.writer(out, delimiter=mark, lineterminator="\n").writerows(
            without(row, found) if any(row) else [] for row in rows
        )
        stated = tuple(filter(None, (reported(row, found) for row in rows[: found.last + 1])))
        return out.getvalue().encode(), stated
    return None
