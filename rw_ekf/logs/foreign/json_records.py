"""JSON: a line for each row, or one document with a list of rows, a list for each column, or pandas' table in it.

So too YAML, a document for each row, as `rostopic echo` and `ros2 topic echo` print messages.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.errors import EmptyLogError, LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.csv_table import read_csv_table
from rw_ekf.logs.foreign.format_library import foreign_format
from rw_ekf.logs.foreign.groups import OWN_COLUMNS, Group, table_of_groups
from rw_ekf.logs.interleaved import held
from rw_ekf.logs.labels import with_labels
from rw_ekf.logs.log_text import LogText
from rw_ekf.logs.raw_table import RawTable, number_or_none

_BEGIN = re.compile(rb'(\xef\xbb\xbf)?\s*(\{\s*"|\[\s*[\[{])')
_DOCUMENTS = re.compile(  # of a header with its stamp, as messages of ROS begin, or two that are short
    rb"\s*(?:header:\s*\n\s+(?:seq|stamp):|[A-Za-z_]\w*:[ \r\n](?:.*?\n---[ \t]*\r?\n){2})", re.DOTALL
)
_BETWEEN = re.compile(r"^---[ \t]*\r?\n", re.MULTILINE)
_DEEPEST = 8
_ROWS = ("data", "rows", "values")  # what rows beside `columns` are called
_JOURNAL = ("__REALTIME_TIMESTAMP", "MESSAGE")  # systemd's: the time in us from 1970, and what was logged
_TRUTH = {"true": 1.0, "false": 0.0}


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """The rows; of objects within objects by path, `motor.rpm`, but of this program's own samples by their names.

    Raises LogError for what holds no table.
    """
    table = _as_it_is(path, name, columns)
    return table if columns.sources else _own_samples(table)


def _own_samples(table: RawTable) -> RawTable:
    """What PlotJuggler or a broker got of a run, as the log that it was sent beside: its samples alone."""
    for at in (name.removesuffix("time_s") for name in table.names if name.endswith(".time_s")):
        if {at + column for column in OWN_COLUMNS} <= set(table.names):
            held = [i for i, name in enumerate(table.names) if name.startswith(at)]
            names = tuple(table.names[i].removeprefix(at) for i in held)
            return replace(table, names=names, columns=[table.columns[i] for i in held])
    return table


def _as_it_is(path: Path, name: str, columns: ColumnMap) -> RawTable:
    text = path.read_text(encoding="utf-8-sig")
    try:
        document = json.loads(text)
    except json.JSONDecodeError:
        return _of_lines(text, name, columns)
    if columns.variable is not None:
        document = _within(document, columns.variable, name)
    if (groups := _series(document)) is not None:
        return table_of_groups(groups, columns, name)
    if (lines := _logged(document, name)) is not None:
        return read_csv_table(LogText(Path(name), lines), columns.csv, columns.uses, name)
    found = _table_in(document, 0)
    if found is None:
        raise LogError(f"{name}: is JSON without a table: it takes a list of rows, or a list for each column")
    held, beside = found
    return table_of_lists(held, beside, name, lambda row: f"row {row + 1}")


def _queried(document: Any, kind: str) -> list[Any] | None:
    """What Prometheus or Loki answers of a kind; None for any other document."""
    held = document.get("data", document) if isinstance(document, dict) else {}
    result = held.get("result") if isinstance(held, dict) and held.get("resultType") == kind else None
    return result if isinstance(result, list) else None


def _logged(document: Any, name: str) -> bytes | None:
    """The lines that Loki answers, in order of time, each behind its time [s] from 1970; None for any other document.

    (grafana.com/docs/loki/latest/reference/loki-http-api: `resultType` "streams", times in ns.) Raises LogError where
    more than the level of its lines distinguishes one stream from another.
    """
    streams = _queried(document, "streams")
    if streams is None:
        return None
    labels = {tuple(sorted((k, v) for k, v in one["stream"].items() if "level" not in k)) for one in streams}
    if len(labels) > 1:
        shown = "; ".join(", ".join(f"{key}={value}" for key, value in each) for each in sorted(labels)[:4])
        raise LogError(f"{name}: holds {len(labels)} streams of Loki ({shown}): ask Loki for one of them")
    lines = sorted((int(entry[0]), entry[1].strip()) for one in streams for entry in one["values"])
    return _stamped(lines)


def _stamped(lines: Iterable[tuple[int, str]]) -> bytes:
    """Lines, each behind its time [ns], as a text in which it stands in seconds."""
    return "".join(f"[{time // 10**9}.{time % 10**9:09d} s] {line}\n" for time, line in lines).encode()


def _series(document: Any) -> list[Group] | None:
    """The series of a range that Prometheus answers, those of the same times together; None for any other document.

    Each is called what its metric is, after the labels that distinguish it from others of that name. Times are in s
    from 1970 (prometheus.io/docs/prometheus/latest/querying/api: `resultType` "matrix").
    """
    result = _queried(document, "matrix")
    if result is None:
        return None
    metrics = [dict(one["metric"]) for one in result]
    channels: dict[tuple[float, ...], dict[str, Any]] = {}
    for metric, one in zip(metrics, result, strict=True):
        called = metric.get("__name__", "value")
        alike = [other for other in metrics if other.get("__name__", "value") == called]
        telling = [key for key in sorted(metric) if len({other.get(key) for other in alike}) > 1]
        label = " ".join((*(f"{key}={metric[key]}" for key in telling), called))
        times = tuple(float(time) for time, _ in one["values"])
        channels.setdefault(times, {})[label] = _column([value for _, value in one["values"]])
    return [Group(f"series {number}", np.array(times), held) for number, (times, held) in enumerate(channels.items())]


def _of_lines(text: str, name: str, columns: ColumnMap) -> RawTable:
    """A row for each line that is an object; the last may be torn."""
    rows, lines, wrong = list[dict[str, Any]](), list[int](), list[int]()
    numbered = [(number, line) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    for number, line in numbered:
        try:
            record = json.loads(line.strip().rstrip(","))
        except json.JSONDecodeError:
            wrong.append(number)
            continue
        if isinstance(record, list) and all(map(_is_number, record)):  # of columns without names
            record = {str(place): value for place, value in enumerate(record)}
        if isinstance(record, dict):
            rows.append(dict(_flat(record)))
            lines.append(number)
    if len(wrong) > max(1, len(numbered) // 100):
        raise LogError(f"{name}: line {wrong[0]}: is no JSON, as {len(wrong)} of {len(numbered)} lines: mend them")
    stamp, message = _JOURNAL
    if rows and all(str(row.get(stamp, "")).isdecimal() for row in rows):
        messages = [(int(row[stamp]), row[message]) for row in rows if isinstance(row.get(message), str)]
        stated = _stamped((1000 * time_us, line) for time_us, line in messages)
        return read_csv_table(LogText(Path(name), stated), columns.csv, columns.uses, name)
    table = _of_records(rows, lines, name)
    if wrong:
        table.torn = wrong[-1] == numbered[-1][0]
        table.warnings.append(f"{name}: line {wrong[0]} is no JSON, and was left out ({len(wrong)} such)")
    return table


def _read_documents(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """A row for each document of YAML; the last may be torn."""
    import yaml

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    rows, lines, at = list[dict[str, Any]](), list[int](), 1
    texts = _BETWEEN.split(path.read_text(encoding="utf-8-sig"))
    for number, text in enumerate(texts):
        try:
            record = yaml.load(text, loader)
        except yaml.YAMLError:
            if number < len(texts) - 1:
                raise LogError(f"{name}: the document at line {at} is no YAML: mend it, or cut it out") from None
            record = None
        if isinstance(record, dict):
            rows.append(dict(_flat(record)))
            lines.append(at)
        at += text.count("\n") + 1
    return _of_records(rows, lines, name)


def _of_records(rows: list[dict[str, Any]], lines: list[int], name: str) -> RawTable:
    """The table of records, each from its line; what the run was, in a record above them all, stands beside it."""
    beside = dict[str, Any]()
    if not rows:
        raise EmptyLogError(f"{name}: no line holds an object: nothing was logged")
    most = max((frozenset(row) for row in rows), key=len)
    while rows and not {key for key in rows[0] if _is_number(rows[0][key])} & most:  # what the run was, above its rows
        beside |= rows.pop(0)
        lines.pop(0)
    records = [(_kind(row), row) for row in rows]
    if len({kind for kind, _ in records}) > 1:
        rows, places = held(records)
        lines = [lines[place] for place in places]
    return table_of_lists(_by_column(rows), beside, name, lambda row: f"line {lines[row]}")


def _kind(row: dict[str, Any]) -> str:
    """Which kind of message a row is: by the numbers that it has."""
    return "\n".join(sorted(key for key, value in row.items() if _is_number(value) and not isinstance(value, bool)))


def _within(document: Any, variable: str, name: str) -> Any:
    """What stands at a path, `run.samples`. Raises LogError where there is nothing."""
    for key in variable.split("."):
        if not isinstance(document, dict) or key not in document:
            held = ", ".join(document) if isinstance(document, dict) else "no names"
            raise LogError(f"{name}: has no '{variable}' (`variable` in the column map); it holds {held}")
        document = document[key]
    return document


def _table_in(document: Any, depth: int) -> tuple[dict[str, list[Any]], dict[str, Any]] | None:
    """Columns by name, and what stands beside them; None where a document holds no table."""
    if isinstance(document, list):
        return _of_list(document)
    if not isinstance(document, dict) or depth > _DEEPEST:
        return None
    if (named := _named_rows(document)) is not None:
        other = None if "data" in document else _table_in({**document, "columns": None}, depth + 1)
        return named if other is None or _length(named) >= _length(other) else other
    lists = {key: _as_list(value) for key, value in document.items()}
    columns = {key: value for key, value in lists.items() if value is not None and not _is_rows(value)}
    longest = max((len(value) for value in columns.values()), default=0)
    same = {key: value for key, value in columns.items() if len(value) == longest}
    if longest > 2 and len(same) > 1:
        return same, _beside(document, set(same))
    inner = [(key, found) for key, value in document.items() if (found := _table_in(value, depth + 1)) is not None]
    if not inner:
        return None
    key, (held, beside) = max(inner, key=lambda item: max(map(len, item[1][0].values()), default=0))
    return held, _beside(document, {key}) | beside


def _named_rows(document: Mapping[str, Any]) -> tuple[dict[str, list[Any]], dict[str, Any]] | None:
    """Rows beside the names of their cells: pandas with orient=split, a database's answer; None for anything else."""
    names, key = document.get("columns"), next((key for key in _ROWS if isinstance(document.get(key), list)), "")
    if not isinstance(names, list) or not key or not all(isinstance(row, list) for row in document[key]):
        return None
    if key != "data" and not (document[key] and all(len(row) == len(names) for row in document[key])):
        return None
    stated = [str(name.get("name", at)) if isinstance(name, dict) else str(name) for at, name in enumerate(names)]
    rows = [dict(zip(stated, row, strict=False)) for row in document[key]]
    return _by_column(rows), _beside(document, {"columns", key, "index"})


def _within_lists(rows: list[Any], depth: int) -> tuple[dict[str, list[Any]], dict[str, Any]] | None:
    """The only table of named rows within objects of a list, as InfluxDB 1 answers (`results`, `series`)."""
    found = []
    for value in (value for row in rows for value in row.values() if isinstance(value, list)):
        inner = [each for each in value if isinstance(each, dict)]
        found += [named for each in inner if (named := _named_rows(each)) is not None]
        found += [deeper for deeper in [_within_lists(inner, depth + 1)] if inner and depth < _DEEPEST and deeper]
    return found[0] if len(found) == 1 and _length(found[0]) > len(rows) else None


def _length(table: tuple[dict[str, list[Any]], dict[str, Any]]) -> int:
    return max(map(len, table[0].values()), default=0)


def _of_list(rows: list[Any]) -> tuple[dict[str, list[Any]], dict[str, Any]] | None:
    if rows and all(isinstance(row, dict) for row in rows):
        if (named := _within_lists(rows, 0)) is not None:
            return named
        return _by_column([dict(_flat(row)) for row in rows]), {}
    if len(rows) > 1 and all(isinstance(row, list) for row in rows):
        names = rows[0] if all(isinstance(cell, str) for cell in rows[0]) else [str(n) for n in range(len(rows[0]))]
        body = rows[1:] if names is rows[0] else rows
        return _by_column([dict(zip(names, row, strict=False)) for row in body]), {}
    return None


def _is_numbered(value: Mapping[str, Any]) -> bool:
    return bool(value) and all(key.isdigit() for key in value)


def _is_rows(value: list[Any]) -> bool:
    return any(isinstance(cell, dict | list) for cell in value)


def _as_list(value: Any) -> list[Any] | None:
    """A column: a list, what pandas makes of one, {"0": first, "1": second}, or the only one beside its unit."""
    if isinstance(value, dict):
        if _is_numbered(value):
            return list(value.values())
        lists = [held for held in value.values() if isinstance(held, list | dict)]
        value = lists[0] if len(lists) == 1 else None
    return value if isinstance(value, list) else None


def _beside(document: Mapping[str, Any], columns: set[str]) -> dict[str, Any]:
    """What is stated beside columns; of a column that is an object, what it holds beside its list."""
    kept = {
        key: value
        for key, value in document.items()
        if key not in columns or (isinstance(value, dict) and not _is_numbered(value))
    }
    return dict(_flat(kept))


def _flat(record: Mapping[str, Any], path: str = "", depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Values of an object and of those within it, by path."""
    for key, value in record.items():
        if isinstance(value, dict) and depth < _DEEPEST:
            yield from _flat(value, f"{path}{key}.", depth + 1)
        elif not isinstance(value, list):
            yield f"{path}{key}", value
        elif len(value) == 1 and not isinstance(value[0], dict | list):  # of one joint
            yield f"{path}{key}", value[0]


def _by_column(rows: list[dict[str, Any]]) -> dict[str, list[Any]]:
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: [row.get(name) for row in rows] for name in names}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float)


def table_of_lists(held: dict[str, list[Any]], beside: dict[str, Any], name: str, place: Any) -> RawTable:
    """Columns (name -> n values) as a table, with what stands beside them. Raises EmptyLogError for no rows."""
    rows = len(next(iter(held.values()), []))
    if rows == 0:
        raise EmptyLogError(f"{name}: has no rows: nothing was logged")
    known = {key: value for key, value in beside.items() if value is not None}
    same = {key: next(iter(found)) for key, values in held.items() if len(found := _texts_in(values)) == 1}
    known |= same
    kept = {key: values for key, values in held.items() if key not in same}
    table = RawTable(name, tuple(kept), [_column(values) for values in kept.values()], rows, place)
    return with_labels(table, known)


def _texts_in(values: list[Any]) -> set[str]:
    """The different texts of a column; none where it holds anything else."""
    known = {value for value in values if value is not None}
    return known if all(isinstance(value, str) for value in known) else set()


def _column(values: list[Any]) -> Any:
    """Numbers (n,), NaN where there is none; texts where one of them is no number."""
    numbers = [_number(value) for value in values]
    if None not in numbers:
        return np.array(numbers, dtype=np.float64)
    import pyarrow as pa

    return pa.array([None if value is None else str(value) for value in values], type=pa.string())


def _number(value: Any) -> float | None:
    if value is None:
        return float("nan")
    if isinstance(value, str):
        return _TRUTH.get(value.lower(), number_or_none(value))
    return float(value) if isinstance(value, int | float) else None


FORMAT = foreign_format(
    "JSON",
    lambda head, suffix: suffix in (".json", ".jsonl", ".ndjson") or bool(_BEGIN.match(head)),
    "a first brace or bracket; .json, .jsonl, .ndjson",
    _read,
    otherwise="save it as CSV",
)
YAML = foreign_format(
    "a stream of YAML documents",
    lambda head, suffix: bool(_DOCUMENTS.match(head)),
    "a first key, and lines of --- between documents",
    _read_documents,
    otherwise="save it as CSV",
)
