"""Igor Pro's text files (.itx): blocks of waves, and commands that say on which axis and in which units these are."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.column_units import unit_of
from rw_ekf.logs.foreign.format_library import foreign_format
from rw_ekf.logs.foreign.groups import Group, table_of_groups
from rw_ekf.logs.raw_table import RawTable

_BEGIN = re.compile(rb"IGOR\s*[\r\n]")
_WAVES = re.compile(r"WAVES(?P<flags>(?:\s*/\w+(?:=\([^)]*\))?)*)[\s,]+(?P<names>.+)", re.IGNORECASE)
_NAME = re.compile(r"'([^']+)'|([^\s,;'\"]+)")
_NUMBER = r"[+-]?[\d.]+(?:e[+-]?\d+)?"
_SCALE = re.compile(  # SetScale/P: the first value and the step; /I: first and last; else the first and that behind all
    rf"SetScale\s*(?:/(?P<kind>[PI])\s*)?(?P<axis>\w),?\s*(?P<first>{_NUMBER}),\s*(?P<second>{_NUMBER}),\s*"
    r"\"(?P<unit>[^\"]*)\",?\s*(?P<names>[^;]*)",
    re.IGNORECASE,
)
_NOTE = re.compile(r"Note\s+(?P<name>'[^']+'|[^\s,]+),?\s*\"(?P<text>[^\"]*)\"", re.IGNORECASE)
_DATES = "dat"  # unit of an axis of dates, in seconds


@dataclass(eq=False)
class _Wave:
    """One wave of n numbers."""

    values: Float64Array  # (n,)
    unit: str = ""
    axis: tuple[float, float] | None = None  # time of its first number and step [s], where its axis is one of time
    remark: str = ""


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """Waves of one axis and length are a group, called as its first wave."""
    groups: dict[object, Group] = {}
    for key, wave in _waves(re.split(r"\r\n|\r|\n", path.read_text(encoding="utf-8", errors="replace"))).items():
        rows = len(wave.values)
        time_s = None if wave.axis is None else wave.axis[0] + wave.axis[1] * np.arange(rows, dtype=np.float64)
        group = groups.setdefault((wave.axis, rows), Group(key, time_s, {}))
        group.channels[key] = wave.values
        group.units |= {key: wave.unit} if wave.unit else {}
        group.remarks |= {key: wave.remark} if wave.remark else {}
    return table_of_groups(list(groups.values()), columns, name)


def _waves(lines: list[str]) -> dict[str, _Wave]:
    """The waves of one dimension, by name. Raises ValueError for a row that has not a number for each."""
    found: dict[str, _Wave] = {}
    at = 0
    while at < len(lines):
        line = lines[at].strip()
        at += 1
        if (block := _WAVES.fullmatch(line)) is not None:
            names = [quoted or bare for quoted, bare in _NAME.findall(block["names"])]
            begin = _line_of("BEGIN", lines, at) + 1
            at = _line_of("END", lines, begin)
            if re.search(r"/N=\([^)]*,|/T|/C", block["flags"].replace(" ", ""), re.IGNORECASE):
                continue  # a matrix, texts, complex numbers
            rows = [list(map(float, row.split())) for row in lines[begin:at] if row.strip()]
            if any(len(row) != len(names) for row in rows):
                raise ValueError(f"a row below line {begin} has not {len(names)} numbers")
            found |= {
                each: _Wave(np.array(values)) for each, values in zip(names, zip(*rows, strict=True), strict=False)
            }
        elif line[:2].upper() == "X ":
            _obey(line[2:], found)
    return found


def _line_of(word: str, lines: list[str], at: int) -> int:
    """The next line (from 0) that holds a word alone. Raises ValueError where none does."""
    found = next((number for number in range(at, len(lines)) if lines[number].strip().upper() == word), None)
    if found is None:
        raise ValueError(f"line {at}: no {word} behind it")
    return found


def _obey(command: str, waves: dict[str, _Wave]) -> None:
    """Take from a line of commands what it says of waves: axis, unit, note."""
    for scale in _SCALE.finditer(command):
        for wave in (waves[key] for quoted, bare in _NAME.findall(scale["names"]) if (key := quoted or bare) in waves):
            if scale["axis"].lower() in "yd":
                wave.unit = scale["unit"]
                continue
            unit = unit_of("s" if scale["unit"] == _DATES else scale["unit"])
            if scale["axis"].lower() != "x" or unit is None or unit.quantity != "time":
                continue
            first, second = float(scale["first"]), float(scale["second"])
            kind, count = (scale["kind"] or "").upper(), len(wave.values)
            step = second if kind == "P" else (second - first) / max(1, count - (kind == "I"))
            wave.axis = (first * unit.factor, step * unit.factor)
    for note in _NOTE.finditer(command):
        if (key := note["name"].strip("'")) in waves:
            waves[key].remark = note["text"]


FORMAT = foreign_format(
    "a text file of Igor Pro",
    lambda head, suffix: bool(_BEGIN.match(head)),
    "a first line 'IGOR'",
    _read,
)
