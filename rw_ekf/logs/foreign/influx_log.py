"""InfluxDB exports: the line protocol, and annotated CSV."""

from __future__ import annotations

import csv
import datetime
import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from rw_ekf.errors import LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.format_library import foreign_format
from rw_ekf.logs.foreign.groups import Group, channels_of, seconds_of, table_of_groups
from rw_ekf.logs.raw_table import RawTable, number_or_none

_KEY = r"(?:\\.|[^\s,=\\])+"
_VALUE = r'"(?:\\.|[^"\\])*"|[^\s,="]+'
_POINT = re.compile(
    rf"(?P<name>{_KEY})(?P<tags>(?:,{_KEY}={_KEY})*) +(?P<fields>{_KEY}=(?:{_VALUE})(?:,{_KEY}=(?:{_VALUE}))*)"
    r"(?: +(?P<time>-?\d{1,19}))?"
)
_FIELD = re.compile(rf"({_KEY})=({_VALUE})")
_BEGIN = re.compile(  # the time, tags or a second field: `sample rate=100` may head any text
    rf"(?:(?:#[^\n]*|CREATE [^\n]*|)\r?\n)*{_KEY}(?:(?:,{_KEY}={_KEY})+ +{_KEY}=|"
    rf" +{_KEY}=(?:{_VALUE})(?:,{_KEY}=| +\d{{9,19}}\r?\n))".encode()
)
_SUFFIXES = (".lp", ".line", ".influx")
_NO_POINT = ("#", "CREATE ")  # comments, and what influx_inspect writes to make the database
_ANNOTATIONS = (b"#group", b"#datatype", b"#default")
_TRUTH = {"t": 1.0, "true": 1.0, "f": 0.0, "false": 0.0}
# From which number on a time since 1973 has how many units a second.
_UNITS = ((10**17, 10**9), (10**14, 10**6), (10**11, 10**3), (0, 1))
_OWN = ("", "result", "table", "_start", "_stop", "_time", "_value", "_field", "_measurement")
_FRACTION = re.compile(r"(.*:\d\d)(?:\.(\d{1,9}))?Z")


@dataclass
class _Series:
    """Points of one measurement with the same tags."""

    measurement: str
    rows: dict[int, dict[str, float]] = field(default_factory=dict)  # by time; by number where there is none
    timed: bool = True

    def add(self, time: int | None, fields: dict[str, float]) -> None:
        """Add fields; an export may have a line for each field of one time."""
        self.timed = self.timed and time is not None
        self.rows.setdefault(len(self.rows) if time is None else time, {}).update(fields)


def _read_lines(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """Measurements as groups. Raises LogError for a line that is no point."""
    series: dict[str, _Series] = {}
    torn: list[str] = []
    before = ""  # the time of the line above
    with path.open(encoding="utf-8", errors="replace") as text:
        for number, line in enumerate(text, start=1):
            stripped = line.strip()
            if not stripped or stripped.startswith(_NO_POINT):
                continue
            point = _POINT.fullmatch(stripped)
            if before and not line.endswith("\n") and (point is None or len(point["time"] or "") != len(before)):
                torn.append(f"{name}: line {number}: the last line is torn off, and was left out")
                break
            if point is None:
                raise LogError(f"{name}: line {number}: is no point of the line protocol: mend or remove it")
            one = series.setdefault(_plain(point["name"] + point["tags"]), _Series(_plain(point["name"])))
            before = point["time"] or ""
            fields = {_plain(key): _value(value) for key, value in _FIELD.findall(point["fields"])}
            one.add(None if point["time"] is None else int(point["time"]), _numbers(fields))
    largest = max((abs(time) for one in series.values() if one.timed for time in one.rows), default=0)
    per_second = next(per_second for least, per_second in _UNITS if largest >= least)  # nothing else says it
    table = table_of_groups(_groups(series, per_second), columns, name)
    table.warnings += torn
    return table


def _read_annotated(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """Measurements as groups, from a row for each value (`_field`, `_value`) or for each time.

    Raises LogError where a time cannot be read.
    """
    series: dict[str, _Series] = {}
    header: list[str] | None = None
    kinds: list[str] = []
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as text:
        for number, cells in enumerate(csv.reader(text), start=1):
            if not any(cells):
                header = None
            elif cells[0].startswith("#"):
                header, kinds = None, cells if cells[0] == "#datatype" else kinds
            elif header is None:
                header = cells
            else:
                try:
                    _add_row(series, dict(zip(header, cells, strict=False)), dict(zip(header, kinds, strict=False)))
                except ValueError as error:
                    raise LogError(f"{name}: record {number}: {error}: mend or remove it") from None
    return table_of_groups(_groups(series, 10**9), columns, name)


def _add_row(series: dict[str, _Series], row: dict[str, str], kinds: dict[str, str]) -> None:
    """One row of annotated CSV. Raises ValueError for a time that is none."""
    measurement = row.get("_measurement") or "result"
    further = {key: value for key, value in row.items() if key not in _OWN}
    if "_field" in row:
        fields, tags = {row["_field"]: _value(row.get("_value", ""))}, further
    else:
        tags = {key: value for key, value in further.items() if kinds.get(key, "double") in ("string", "tag")}
        fields = {key: _value(value) for key, value in further.items() if key not in tags}
    name = measurement + "".join(f",{key}={value}" for key, value in tags.items())
    time = row.get("_time", "")
    series.setdefault(name, _Series(measurement)).add(_nanoseconds(time) if time else None, _numbers(fields))


def _groups(series: dict[str, _Series], per_second: int) -> list[Group]:
    """Series as groups in the order of time; one that is alone in its measurement goes by that."""
    counts = Counter(one.measurement for one in series.values())
    groups = []
    for name, one in series.items():
        times = sorted(one.rows)
        time_s = seconds_of(times, per_second) if one.timed else None
        shown = name if counts[one.measurement] > 1 else one.measurement
        groups.append(Group(shown, time_s, channels_of([one.rows[time] for time in times])))
    return groups


def _nanoseconds(stamp: str) -> int:
    """A time of RFC 3339 since 1970. Raises ValueError for anything else."""
    match = _FRACTION.fullmatch(stamp)
    if match is None:
        return round(datetime.datetime.fromisoformat(stamp).timestamp() * 1e6) * 1000
    whole = datetime.datetime.fromisoformat(f"{match[1]}+00:00")
    return round(whole.timestamp()) * 1_000_000_000 + int((match[2] or "").ljust(9, "0"))


def _value(text: str) -> float | None:
    """A field's value; truth is 1 or 0, a text None."""
    truth = _TRUTH.get(text.lower())
    return truth if truth is not None else number_or_none(text[:-1] if text[-1:] in ("i", "u") else text)


def _numbers(fields: dict[str, float | None]) -> dict[str, float]:
    return {key: value for key, value in fields.items() if value is not None}


def _plain(key: str) -> str:
    """A key without the strokes before its commas, blanks and equal signs."""
    return re.sub(r"\\([,= ])", r"\1", key)


FORMAT = foreign_format(
    "InfluxDB line protocol",
    lambda head, suffix: suffix in _SUFFIXES or bool(_BEGIN.match(head)),
    "a first point, `name,tag=a field=1 TIME`, or .lp",
    _read_lines,
)
ANNOTATED = foreign_format(
    "annotated CSV of InfluxDB",
    lambda head, suffix: head.removeprefix(b"\xef\xbb\xbf").startswith(_ANNOTATIONS),
    "the first words '#datatype', '#group' or '#default'",
    _read_annotated,
)
