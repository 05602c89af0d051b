"""LabVIEW measurement files (.lvm): a header of keys, then blocks of rows, each with a header of its own."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rw_ekf.errors import EmptyLogError, LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.format_library import foreign_format
from rw_ekf.logs.raw_table import RawTable, number_or_none

_MAGIC = b"LabVIEW Measurement"
_END = "***End_of_Header***"
_REMARK = "Comment"  # the last column, of texts


@dataclass
class _Block:
    """Rows under one header."""

    keys: dict[str, list[str]]
    names: list[str] = field(default_factory=list)
    rows: list[list[float]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)  # from 1, of each row


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """All blocks under each other; a column `segment` counts them where their times begin anew.

    Raises LogError where a row is no numbers, or a block has other columns than the first.
    """
    blocks = [block for block in _blocks(path, name) if block.rows]
    if not blocks:
        raise EmptyLogError(f"{name}: has a header but no rows: nothing was logged")
    for block in blocks[1:]:
        if block.names != blocks[0].names:
            line, found = block.lines[0], ", ".join(block.names)
            raise LogError(f"{name}: line {line}: a block has other columns ({found}) than the first: split the file")
    tables = [_with_times(block) for block in blocks]
    names = blocks[0].names
    held = list(np.concatenate(tables, axis=1))
    starts = [False, *(after[0][0] <= before[0][-1] for before, after in itertools.pairwise(tables))]
    if any(starts) and "segment" not in names:
        held.append(np.repeat(np.cumsum(starts).astype(np.float64), [len(block.rows) for block in blocks]))
        names = [*names, "segment"]
    lines = [line for block in blocks for line in block.lines]
    above = zip(blocks[0].names[1:], blocks[0].keys.get("Y_Unit_Label", []), strict=False)  # each above its column
    units = {column: unit for column, unit in above if unit.strip() and not column.startswith("X_Value")}
    dimensions = {cell.strip() for cell in blocks[0].keys.get("X_Dimension", ["Time"])} - {""}
    timed = dimensions == {"Time"}
    table = RawTable(name, tuple(names), held, len(lines), lambda row: f"line {lines[row]}")
    table.units = units | ({"X_Value": "s"} if timed else {})
    table.remarks = {"X_Value": "time"} if timed else {}
    return table


def _blocks(path: Path, name: str) -> list[_Block]:
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    lines = text.splitlines()
    file_keys: dict[str, list[str]] = {}
    blocks: list[_Block] = []
    separator, header, titled = "\t", dict[str, list[str]](), True
    for number, line in enumerate(lines, start=1):
        cells = line.split(separator)
        if number == 1 or not line.strip(separator + " "):
            continue
        if cells[0] == "Separator":
            separator = "," if "Comma" in line else "\t"
            cells = line.split(separator)
        if cells[0].strip() == _END:
            if not file_keys:
                file_keys = header or {"": []}
            else:
                blocks.append(_Block(file_keys | header))
                titled = False
            header = {}
        elif not titled:
            blocks[-1].names, titled = _titles(cells), True
        elif blocks and not header and (row := _numbers(cells, blocks[-1], name, number)) is not None:
            blocks[-1].rows.append(row)
            blocks[-1].lines.append(number)
        else:
            header[cells[0].strip()] = cells[1:]
    return blocks


def _titles(cells: list[str]) -> list[str]:
    """Names of the columns, without the remark's; `X_Value 2` for the second of a name."""
    names: list[str] = []
    for cell in cells:
        title = cell.strip()
        if title and title != _REMARK:
            count = sum(name == title or name.startswith(f"{title} ") for name in names)
            names.append(f"{title} {count + 1}" if title in names else title)
    return names


def _numbers(cells: list[str], block: _Block, name: str, line: int) -> list[float] | None:
    """Values of a row, a column without times first; None for the first line of the next header."""
    point = (block.keys.get("Decimal_Separator") or ["."])[0]
    values = [number_or_none(cell.replace(point, ".") if point == "," else cell) for cell in cells]
    if values[0] is None:
        return None
    count = len(block.names)
    kept = [*values, *[float("nan")] * (count - len(values))][:count]
    if None in kept:
        column = kept.index(None)
        raise LogError(
            f"{name}: line {line}, column '{block.names[column]}': '{cells[column]}' is not a number: mend or remove "
            "the row"
        )
    return [value for value in kept if value is not None]


def _with_times(block: _Block) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """The columns (columns, rows) of a block; where it has no times they are made from its start and its step."""
    table = np.array(block.rows, dtype=np.float64).T
    if block.keys.get("X_Columns", ["One"])[0] == "No" and block.names[0] == "X_Value":
        begin, step = (number_or_none((block.keys.get(key) or [""])[0].replace(",", ".")) for key in ("X0", "Delta_X"))
        if step is not None and step > 0.0:
            table[0] = (begin if begin is not None and np.isfinite(begin) else 0.0) + step * np.arange(len(block.rows))
    return table


FORMAT = foreign_format(
    "a LabVIEW measurement",
    lambda head, suffix: head.removeprefix(b"\xef\xbb\xbf").startswith(_MAGIC),
    "the first words 'LabVIEW Measurement'",
    _read,
)
