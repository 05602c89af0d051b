"""The mapping file of a foreign log (`--columns map.yaml`): which of its columns is what, in which unit.

    speed_rad_s: {column: v, scale: 1.0, offset: 0.0}     a column by name, or by number counted from 0
    current_A: {constant: 0.0}                            a value that the file does not hold
    speed_rad_s: {derivative_of: x, scale: 1.0}           backward difference over time_s within a segment
    delimiter: ";"    skip_rows: 3    header: false       how a CSV file is laid out
    rate_hz: 100      decimate: 10                        where there is no time column; keep every n-th row
    reverse: true                                         the last row is the first in time
    current_before: true                                  a row's current was in force until it
    restarts: true                                        a segment begins wherever time falls back to its beginning
    repeats: drop                                         rows that repeat the one before; `spread`: coarse stamps
    variable: data    layout: cells                       what to take from a MATLAB file; a sheet, a group, a topic
    only: {column: wheel, value: 2}                       rows of one wheel, where a column distinguishes several
    dbc: wheel.dbc                                        what the frames of a CAN log mean; relative to the map

`column: v` may be shortened to its name alone. The value is scale * column + offset. `unit: mA` takes the numbers
in that unit, before the scale (`unit: counts, counts_per_turn: 4096`). `wrap: 65536` takes the numbers of
the column for a counter of that many (two's complement, an angle that begins anew each turn); `sign_of: dir` gives a
magnitude the sign of another column. docs/logs.md has examples.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

MatlabLayout = Literal["columns", "rows", "cells"]
Repeats = Literal["refuse", "drop", "spread"]


@dataclass(frozen=True)
class Source:
    """Where the values of one log column come from: scale * (column or its derivative) + offset, or a constant."""

    kind: Literal["column", "constant", "derivative"]
    column: str | int | None = None  # by name, or by number counted from 0
    constant: float = 0.0
    scale: float = 1.0
    offset: float = 0.0
    where: str = ""  # file:line:column in the mapping file, for messages
    wrap: float = 0.0  # the column counts modulo this much, before the scale; 0: it does not
    sign_of: str | int | None = None  # the column that holds the sign of this one
    missing: float | None = None  # the number that stands in the column where nothing was measured
    says_scale: bool = False  # the map gives a scale, be it 1: whoever wrote it has thought of the unit

    def line(self, name: str, **changes: object) -> str:
        """The line of a map that says this, as `name`, with other scale, offset, wrap, sign_of, missing or column."""
        own = ("scale", "offset", "wrap", "sign_of", "missing")
        stated = {key: getattr(self, key) for key in own} | changes
        column = stated.pop("column", self.column)
        kind = "derivative_of" if self.kind == "derivative" else "column"
        usual = {"scale": 1.0, "offset": 0.0, "wrap": 0.0, "sign_of": None, "missing": None}
        kept = [f"{key}: {as_written(value)}" for key, value in stated.items() if value != usual[key]]
        return f"`{name}: {{{', '.join([f'{kind}: {as_written(column)}', *kept])}}}`"


@dataclass(frozen=True)
class CsvLayout:
    """How the text is laid out, as far as it was given; None: found out, if it is not as this program writes it.

    `header` None: there is one unless the first row holds numbers only.
    """

    delimiter: str | None = None
    skip_rows: int = 0  # physical lines before the header
    header: bool | None = None
    decimal: str | None = None
    encoding: str | None = None

    @property
    def separator(self) -> str:
        """The delimiter of a text that is not laid out in another way."""
        return self.delimiter or ","


@dataclass(frozen=True)
class ColumnMap:
    """A checked mapping file. `sources` has a key for each log column that the file maps."""

    path: str = ""
    sources: dict[str, Source] = field(default_factory=dict)
    csv: CsvLayout = field(default_factory=CsvLayout)
    rate_hz: float | None = None
    decimate: int = 1
    reverse: bool = False
    current_before: bool = False  # a row's current was in force before it, from the row before on
    restarts: bool = False
    repeats: Repeats = "refuse"
    variable: str | None = None
    layout: MatlabLayout = "columns"
    dbc: str | None = None  # path
    only: tuple[str | int, str] | None = None  # a column, and which of its values
    wheel: str | None = None  # of several, by name or number, however the file distinguishes them; in no map's file
    guessed: bool = False  # by nobody but the names, units and numbers of the file

    def options(self) -> dict[str, object]:
        """What it says beside the columns, as the file of a map has it; the path of a database from anywhere."""
        stated = {**vars(self), **vars(self.csv)}
        usual = {**vars(ColumnMap()), **vars(CsvLayout())}
        found = {key: stated[key] for key in usual if stated[key] != usual[key] and key not in _NO_OPTIONS}
        if self.only is not None:
            found["only"] = {"column": self.only[0], "value": self.only[1]}
        return found | ({"dbc": str(Path(self.dbc).absolute())} if self.dbc is not None else {})

    def uses(self, number: int, name: str) -> bool:
        """Whether a source takes the numbers of the column with this number or name; a direction may be in words."""
        taken = [source.column for source in self.sources.values()]
        return any(column == number or (bool(name) and column == name) for column in taken if column is not None)


_NO_OPTIONS = ("path", "sources", "csv", "wheel", "guessed")


def as_written(value: object) -> str:
    """A value as a map has it: `1000`, not `1000.0`; a name in quotes where YAML requires them."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {as_written(part)}' for key, part in value.items())}}}"
    if isinstance(value, str):
        plain = re.fullmatch(r"[A-Za-z_][\w.]*", value) and value.lower() not in _WORDS_OF_YAML
        return value if plain else json.dumps(value, ensure_ascii=False)
    return str(int(value)) if isinstance(value, float) and value.is_integer() and abs(value) < 1e15 else f"{value}"


_WORDS_OF_YAML = frozenset({"y", "n", "yes", "no", "on", "off", "true", "false", "null", "nan", "inf"})
