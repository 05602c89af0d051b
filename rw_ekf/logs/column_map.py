"""The mapping file of a foreign log (`--columns map.yaml`): which of its columns is what, in which unit.

    speed_rad_s: {column: v, scale: 1.0, offset: 0.0}     a column by name, or by number counted from 0
    current_A: {constant: 0.0}                            a value that the file does not hold
    speed_rad_s: {derivative_of: x, scale: 1.0}           backward difference over time_s within a segment
    delimiter: ";"    skip_rows: 3    header: false       how a CSV file is laid out
    rate_hz: 100      decimate: 10                        where there is no time column; keep every n-th row
    reverse: true                                         the last row is the first in time
    variable: data    layout: cells                       what to take from a MATLAB file

`column: v` may be shortened to its name alone. The value is scale * column + offset. `wrap: 65536` takes the numbers of
the column for a counter of that many (two's complement, an angle that begins anew each turn); `sign_of: dir` gives a
magnitude the sign of another column. docs/logs.md has examples.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from rw_ekf.errors import ConfigError
from rw_ekf.logs.csv_table import CsvLayout
from rw_ekf.logs.wheel_log import READABLE_COLUMNS
from rw_ekf.settings.wording import shown, suggestion
from rw_ekf.settings.yaml_loader import PathTuple, YamlDocument, load_yaml

MatlabLayout = Literal["columns", "rows", "cells"]
_LAYOUTS = ("columns", "rows", "cells")
_SOURCE_KEYS = ("column", "constant", "derivative_of", "scale", "offset", "wrap", "sign_of")
_OPTIONS = ("delimiter", "skip_rows", "header", "rate_hz", "decimate", "reverse", "variable", "layout")
_MAX_RATE_HZ = 1e6


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
    says_scale: bool = False  # the map gives a scale, be it 1: whoever wrote it has thought of the unit

    def line(self, name: str, **changes: object) -> str:
        """The line of a map that says this, as `name`, with other scale, offset, wrap, sign_of or column."""
        said = {"scale": self.scale, "offset": self.offset, "wrap": self.wrap, "sign_of": self.sign_of} | changes
        column = said.pop("column", self.column)
        kind = "derivative_of" if self.kind == "derivative" else "column"
        usual = {"scale": 1.0, "offset": 0.0, "wrap": 0.0, "sign_of": None}
        kept = [f"{key}: {_plain(value)}" for key, value in said.items() if value != usual[key]]
        return f"`{name}: {{{', '.join([f'{kind}: {_plain(column)}', *kept])}}}`"


@dataclass(frozen=True)
class ColumnMap:
    """A checked mapping file. `sources` has a key for each log column that the file maps."""

    path: str = ""
    sources: dict[str, Source] = field(default_factory=dict)
    csv: CsvLayout = field(default_factory=CsvLayout)
    rate_hz: float | None = None
    decimate: int = 1
    reverse: bool = False
    variable: str | None = None
    layout: MatlabLayout = "columns"

    def uses(self, number: int, name: str) -> bool:
        """Whether a source takes the column with this number or name."""
        taken = [column for source in self.sources.values() for column in (source.column, source.sign_of)]
        return any(column == number or (bool(name) and column == name) for column in taken if column is not None)


def load_column_map(path: str | Path) -> ColumnMap:
    """Read and check a mapping file. Raises ConfigError with one finding per mistake."""
    document = load_yaml(path)
    if not isinstance(document.data, dict):
        raise ConfigError(f"{document.where()}: a column map is a table of columns, found {shown(document.data)}")
    reader = _MapReader(document)
    result = reader.read()
    if reader.findings:
        raise ConfigError(reader.findings)
    return result


class _MapReader:
    """Checks the parsed file key by key and collects findings."""

    def __init__(self, document: YamlDocument) -> None:
        self.document = document
        self.data: dict[Any, Any] = document.data
        self.findings: list[str] = []

    def read(self) -> ColumnMap:
        sources: dict[str, Source] = {}
        for key, value in self.data.items():
            if key in READABLE_COLUMNS:
                source = self._source(key, value)
                if source is not None:
                    sources[key] = source
            elif key not in _OPTIONS:
                known = (*READABLE_COLUMNS, *_OPTIONS)
                self._add(self.document.where_key((key,)), f"unknown key {key}; {suggestion(key, known)}")
        result = ColumnMap(
            path=self.document.path,
            sources=sources,
            csv=CsvLayout(self._delimiter(), self._count("skip_rows", 0, 0), self._flag("header")),
            rate_hz=self._rate(),
            decimate=self._count("decimate", 1, 1),
            reverse=self._flag("reverse") or False,
            variable=self._text("variable"),
            layout=self._layout(),
        )
        self._check_together(result)
        return result

    def _source(self, key: str, value: Any) -> Source | None:
        place = self.document.where_key((key,))
        if isinstance(value, str):
            return Source("column", value, where=place)
        if not isinstance(value, dict):
            hint = "{column: name or number} or {constant: value}"
            self._add(place, f"{key}: write {hint}, found {shown(value)}")
            return None
        for name in value:
            if name not in _SOURCE_KEYS:
                self._add(
                    self.document.where_key((key, name)), f"unknown key {key}.{name}; {suggestion(name, _SOURCE_KEYS)}"
                )
        kinds = [name for name in ("column", "constant", "derivative_of") if name in value]
        if len(kinds) != 1:
            found = " and ".join(kinds) or "none of them"
            self._add(place, f"{key}: give exactly one of column, constant, derivative_of; found {found}")
            return None
        scale, offset = self._number((key, "scale"), value, 1.0), self._number((key, "offset"), value, 0.0)
        if scale == 0.0:
            self._add(self.document.where((key, "scale")), f"{key}.scale: 0 leaves nothing of it; give a constant")
        if kinds[0] == "constant":
            return self._constant(key, value, place)
        column = value[kinds[0]]
        if not self._is_column((key, kinds[0]), column):
            return None
        if kinds[0] == "derivative_of" and not key.startswith("speed_"):
            self._add(place, f"{key}: only a speed can be a derivative (speed_rad_s or speed_rpm)")
        kind: Literal["column", "derivative"] = "column" if kinds[0] == "column" else "derivative"
        wrap = self._number((key, "wrap"), value, 0.0)
        if wrap < 0.0 or ("wrap" in value and wrap == 0.0):
            self._add(self.document.where((key, "wrap")), f"{key}.wrap: must be above 0, found {wrap:g}")
        sign_of = value.get("sign_of")
        if sign_of is not None and not self._is_column((key, "sign_of"), sign_of):
            return None
        if sign_of is not None and kind == "derivative":
            self._add(self.document.where((key, "sign_of")), f"{key}.sign_of: a derivative has its own sign")
        return Source(kind, column, 0.0, scale, offset, place, wrap, sign_of, says_scale="scale" in value)

    def _constant(self, key: str, value: dict[Any, Any], place: str) -> Source:
        if key in ("time_s", "segment"):
            self._add(place, f"{key}: cannot be a constant" + ("; give rate_hz instead" if key == "time_s" else ""))
        for name in ("scale", "offset", "wrap", "sign_of"):
            if name in value:
                self._add(self.document.where_key((key, name)), f"{key}.{name}: has no meaning beside a constant")
        return Source("constant", constant=self._number((key, "constant"), value, 0.0), where=place)

    def _is_column(self, path: PathTuple, column: Any) -> bool:
        if isinstance(column, bool) or not isinstance(column, str | int) or column == "":
            self._add(self.document.where(path), f"{_dotted(path)}: a name or a number, found {shown(column)}")
        elif isinstance(column, int) and column < 0:
            self._add(self.document.where(path), f"{_dotted(path)}: columns are counted from 0, found {column}")
        else:
            return True
        return False

    def _number(self, path: PathTuple, table: dict[Any, Any], default: float) -> float:
        value = table.get(path[-1], default)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self._add(self.document.where(path), f"{_dotted(path)} must be a number, found {shown(value)}")
            return default
        try:
            return float(value)
        except OverflowError:
            self._add(self.document.where(path), f"{_dotted(path)} is too large for a number")
            return default

    def _count(self, key: str, default: int, least: int) -> int:
        value = self.data.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            place = self.document.where((key,))
            self._add(place, f"{key} must be a whole number of at least {least}, found {shown(value)}")
            return default
        return value

    def _rate(self) -> float | None:
        if self.data.get("rate_hz") is None:
            return None
        rate_hz = self._number(("rate_hz",), self.data, 1.0)
        if not 0.0 < rate_hz <= _MAX_RATE_HZ:
            self._add(
                self.document.where(("rate_hz",)), f"rate_hz must be above 0, at most 1e6 [Hz], found {rate_hz:g}"
            )
        return rate_hz

    def _flag(self, key: str) -> bool | None:
        value = self.data.get(key)
        if value is not None and not isinstance(value, bool):
            self._add(self.document.where((key,)), f"{key} must be true or false, found {shown(value)}")
            return None
        return value

    def _delimiter(self) -> str:
        value = self.data.get("delimiter", ",")
        value = "\t" if value in ("\\t", "tab") else value
        if not isinstance(value, str) or len(value) != 1 or value in '"\r\n' or not value.isascii():
            message = f'delimiter must be one character such as ";" or "\\t", found {shown(value)}'
            self._add(self.document.where(("delimiter",)), message)
            return ","
        return value

    def _text(self, key: str) -> str | None:
        value = self.data.get(key)
        if value is not None and (not isinstance(value, str) or not value):
            self._add(self.document.where((key,)), f"{key} must be a name, found {shown(value)}")
            return None
        return value

    def _layout(self) -> MatlabLayout:
        value = self.data.get("layout", "columns")
        if value not in _LAYOUTS:
            found = f"layout must be one of {', '.join(_LAYOUTS)}; found {shown(value)}"
            self._add(self.document.where(("layout",)), found)
            return "columns"
        return value  # type: ignore[no-any-return]

    def _check_together(self, result: ColumnMap) -> None:
        if result.rate_hz is not None and "time_s" in result.sources:
            place = self.document.where_key(("rate_hz",))
            self._add(place, "rate_hz stands in for a time column, but time_s is mapped too: drop one of them")
        if "speed_rpm" in result.sources and "speed_rad_s" in result.sources:
            place = self.document.where_key(("speed_rpm",))
            self._add(place, "speed_rpm and speed_rad_s are both mapped: drop one of them")

    def _add(self, place: str, message: str) -> None:
        self.findings.append(f"{place}: {message}")


def _plain(value: object) -> str:
    """A value as a map has it: `1000`, not `1000.0`; a name in quotes where YAML asks for them."""
    if isinstance(value, str) and not re.fullmatch(r"[A-Za-z_][\w.]*", value):
        return json.dumps(value, ensure_ascii=False)
    return str(int(value)) if isinstance(value, float) and value.is_integer() and abs(value) < 1e15 else f"{value}"


def _dotted(path: PathTuple) -> str:
    return ".".join(map(str, path))
