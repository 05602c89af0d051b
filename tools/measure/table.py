"""A table of measured numbers beside their marks."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One line of the table; `met` is None where there is no mark."""

    what: str
    value: str
    mark: str = ""
    met: bool | None = None


def at_most(what: str, value: float, mark: float, unit: str = "") -> Row:
    """A row whose value may not exceed its mark."""
    return Row(what, f"{value:.3g}{unit}", f"<= {mark:g}{unit}", value <= mark)


def show(rows: list[Row]) -> None:
    """Print the table: what, value, mark, and whether it is met."""
    wide, narrow = max(len(row.what) for row in rows), max(len(row.value) for row in rows)
    for row in rows:
        verdict = {None: "", True: "ok", False: "MISSED"}[row.met]
        print(f"{row.what:<{wide}}  {row.value:>{narrow}}  {row.mark:<16}  {verdict}".rstrip())
