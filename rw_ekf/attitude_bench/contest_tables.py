"""A table of the bench, once for a terminal and once for a page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

_WIDEST = 24  # characters of a terminal's column


@dataclass(frozen=True)
class Table:
    """Heads, units and rows of texts; the first columns are words, set to the left."""

    title: str
    heads: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: int  # how many columns are words
    notes: tuple[str, ...] = ()

    def text(self) -> str:
        """For a terminal."""
        lines = [tuple(map(_shortened, line)) for line in (self.heads, self.units, *self.rows)]
        widths = [max(len(line[i]) for line in lines) for i in range(len(self.heads))]
        shown = [
            "  ".join(f"{cell:{'<' if i < self.words else '>'}{widths[i]}}" for i, cell in enumerate(line))
            for line in lines
        ]
        return "\n".join([self.title, *(f"  {line}".rstrip() for line in shown), *self.notes]) + "\n"

    @property
    def headings(self) -> list[str]:
        """For a page: heads with their units."""
        return [f"{head} [{unit}]" if unit else head for head, unit in zip(self.heads, self.units, strict=True)]


def _shortened(cell: str) -> str:
    return cell if len(cell) <= _WIDEST else cell[: _WIDEST - 1] + "…"


def shown(value: float, places: int) -> str:
    """A figure; a dash where there is none."""
    return f"{value:.{places}f}" if math.isfinite(value) else "-"


def texts(tables: Sequence[Table]) -> str:
    """Several, an empty line between."""
    return "\n".join(table.text() for table in tables)
