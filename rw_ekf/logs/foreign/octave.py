"""Octave's text files (`save -text`): variables by name, as those of a MATLAB file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.format_library import foreign_format
from rw_ekf.logs.matlab_table import table_of_variables
from rw_ekf.logs.raw_table import RawTable

_BEGIN = re.compile(rb"[#%] Created by Octave ")
_NUMBERS = re.compile(r"(float |bool |u?int\d+ )?(matrix|scalar)|bool")
_ROUND = 1e-10  # relative: so much may the last of a range lie beyond its limit

_MOST = 10**8  # numbers of a range, 0.8 GB: more has no log, only a damaged line


@dataclass
class _Text:
    """Lines that are read in turn. Strings are counted in bytes there: each byte is a character here."""

    lines: list[str]
    at: int = 0

    def line(self) -> str:
        """The next line. Raises IndexError behind the last one."""
        self.at += 1
        return self.lines[self.at - 1]

    def stated(self, *keys: str) -> tuple[str, str]:
        """Key and value of the next line that is not empty, `# rows: 3`. Raises ValueError if it has none of these."""
        while not (line := self.line()).strip():
            pass
        key, _, value = line.lstrip("#% ").partition(":")
        if key.strip() not in keys:
            raise ValueError(f"line {self.at}: has {line[:40]!r} in place of '{keys[0]}'")
        return key.strip(), value.strip()

    def numbers(self, lines: int) -> Float64Array:
        """The numbers (lines, width) of the next lines that are not empty."""
        rows: list[list[str]] = []
        while len(rows) < lines:
            cells = ["nan" if cell == "NA" else cell for cell in self.line().split()]
            rows += [cells] if cells else []
        return np.array(rows, dtype=np.float64)

    def to_next_name(self) -> None:
        """Leave lines up to the next name, or all."""
        while self.at < len(self.lines) and not self.lines[self.at].startswith(("# name:", "% name:")):
            self.at += 1


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """By the rules of `rw_ekf.logs.matlab_table`; variables of other kinds are left out."""
    content = variables(path.read_text(encoding="latin-1"))
    return table_of_variables(content, name, columns.variable, columns.layout)


def variables(written: str) -> dict[str, Any]:
    """What a file holds, by name, a character for each of its bytes; raises ValueError or IndexError where it ends."""
    text = _Text(written.split("\n"))
    content: dict[str, Any] = {}
    text.to_next_name()
    while text.at < len(text.lines):
        key, content[key] = text.stated("name")[1], _value(text)
        text.to_next_name()
    return {key: value for key, value in content.items() if value is not None}


def _value(text: _Text) -> Any:
    """The value whose type is stated next; None for one of another type."""
    kind = text.stated("type")[1].removeprefix("global ")
    if kind in ("string", "sq_string"):
        return np.array([_string(text) for _ in range(int(text.stated("elements")[1]))])
    if kind.endswith("range"):
        text.line()  # base, limit, increment
        base, limit, step, *_ = text.numbers(1)[0]
        points = int((limit - base) / step * (1.0 + _ROUND)) + 1
        if points > _MOST:
            raise ValueError(f"a range of {points} numbers")
        return base + step * np.arange(points)
    if kind == "cell":
        shape = int(text.stated("rows")[1]), int(text.stated("columns")[1])
        cells = np.empty(shape[::-1], dtype=object)  # stored column by column
        for place in np.ndindex(cells.shape):
            text.stated("name")
            cells[place] = _value(text)
        return cells.T
    if kind == "scalar struct":
        text.stated("ndims")
        text.numbers(1)
        fields = [(text.stated("name")[1], _value(text)) for _ in range(int(text.stated("length")[1]))]
        struct = np.empty((1, 1), dtype=[(key, object) for key, _ in fields])
        for key, value in fields:
            struct[key][0, 0] = value
        return struct
    if _NUMBERS.fullmatch(kind) is None:
        text.to_next_name()
        return None
    if not kind.endswith("matrix"):
        return text.numbers(1)
    key, count = text.stated("rows", "ndims")
    if key == "rows":  # a line for each
        return text.numbers(int(count)) if int(text.stated("columns")[1]) else None
    shape = text.numbers(1)[0].astype(int)
    return text.numbers(int(np.prod(shape))).reshape(shape, order="F")


def _string(text: _Text) -> str:
    size = int(text.stated("length")[1])
    line = text.line()
    while len(line) < size:  # it has line ends
        line += f"\n{text.line()}"
    return line.encode("latin-1").decode("utf-8", "replace")


FORMAT = foreign_format(
    "a text file of Octave",
    lambda head, suffix: bool(_BEGIN.match(head)),
    "a first line 'Created by Octave'",
    _read,
    otherwise="save it with -v7",
)
