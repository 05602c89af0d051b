"""ArduPilot's DataFlash logs as text: lines of messages, whose columns, units and multipliers other lines define."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rw_ekf.errors import LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.format_library import foreign_format
from rw_ekf.logs.foreign.groups import Group, channels_of, table_of_groups
from rw_ekf.logs.raw_table import RawTable, number_or_none

_CLOCK, _INSTANCE = "TimeUS", "#"  # [us]; the unit that marks the number of a sensor
_DEFINING = ("FMT", "UNIT", "FMTU", "MULT", "PARM", "MSG")


@dataclass
class _Messages:
    """Messages of one name: what its columns are called, their units, and the values."""

    columns: list[str]
    units: str = ""  # a letter for each column
    rows: dict[str, list[dict[str, float]]] = field(default_factory=dict)  # by sensor


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """Messages as groups, `ESC[0]` where several sensors may send them. Raises LogError for a text without any."""
    kinds: dict[str, _Messages] = {}
    numbers: dict[str, str] = {}
    labels: dict[str, str] = {}
    for key, cells in _lines(path):
        if key == "FMT" and len(cells) > 4:
            kinds[cells[2]], numbers[cells[0]] = _Messages(cells[4:]), cells[2]
        elif key == "UNIT" and len(cells) > 2 and cells[1].isdigit():
            labels[chr(int(cells[1]))] = cells[2]
        elif key == "FMTU" and len(cells) > 2 and numbers.get(cells[1]) in kinds:
            kinds[numbers[cells[1]]].units = cells[2]
        elif key in kinds and key not in _DEFINING:
            _add(kinds[key], cells)
    groups = [group for key, messages in kinds.items() for group in _groups(key, messages, labels)]
    if not groups:
        raise LogError(f"{name}: is a DataFlash log without a message that has a time: nothing was logged")
    return table_of_groups(groups, columns, name)


def _lines(path: Path) -> Iterator[tuple[str, list[str]]]:
    with path.open(encoding="utf-8", errors="replace") as text:
        for line in text:
            key, *cells = (cell.strip() for cell in line.split(","))
            yield key, cells


def _add(messages: _Messages, cells: list[str]) -> None:
    """A message, in the units that the log prints: a text log has its multipliers applied."""
    values = {name: number_or_none(cell) for name, cell in zip(messages.columns, cells, strict=False)}
    known = {name: value for name, value in values.items() if value is not None}
    at = messages.units.find(_INSTANCE)
    sensor = cells[at] if 0 <= at < len(cells) else str(int(known["Instance"])) if "Instance" in known else ""
    if _CLOCK in known:
        messages.rows.setdefault(sensor, []).append(known)


def _groups(key: str, messages: _Messages, labels: dict[str, str]) -> Iterator[Group]:
    units = {name: labels.get(letter, "") for name, letter in zip(messages.columns, messages.units, strict=False)}
    for sensor, rows in messages.rows.items():
        channels = channels_of(rows)
        time_s = np.asarray(channels.pop(_CLOCK) / 1.0e6, dtype=np.float64)
        known = {name: unit for name, unit in units.items() if unit and name in channels}
        yield Group(f"{key}[{sensor}]" if sensor else key, time_s, channels, known)


FORMAT = foreign_format(
    "a DataFlash log of ArduPilot",
    lambda head, suffix: head.startswith(b"FMT, 128, 89, FMT,"),
    "a first line 'FMT, 128, 89, FMT, ...'",
    _read,
)
