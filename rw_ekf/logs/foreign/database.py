"""Tables of databases: a file of SQLite, and what mysqldump, pg_dump and SQLite's .dump write of them as SQL text.

Nothing of a dump is run: names of columns come from CREATE TABLE or INSERT, rows from VALUES or COPY.
"""

from __future__ import annotations

import csv
import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from rw_ekf.errors import EmptyLogError, LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.format_library import foreign_format
from rw_ekf.logs.foreign.json_records import table_of_lists
from rw_ekf.logs.interleaved import has_speed
from rw_ekf.logs.raw_table import RawTable, number_or_none

Tables = dict[str, tuple[list[str], list[list[Any]]]]  # by name: columns, rows
_BEGIN = re.compile(
    rb"(\xef\xbb\xbf)?\s*((--|/\*|PRAGMA|BEGIN|SET|DROP)[^\n]*\n\s*)*?"
    rb"(-- (MySQL|MariaDB|PostgreSQL|phpMyAdmin|SQLite)[^\n]* dump|PRAGMA foreign_keys|CREATE TABLE|INSERT INTO)\b",
    re.IGNORECASE,
)
_CALLED = r"\s+(?:IF NOT EXISTS\s+)?(?P<table>[\w.`\"\[\]]+)\s*"
_TEXT = r"'(?:[^'\\]|''|\\.)*+'"  # what has been taken stays taken, here and below: no text is gone through twice
_IN_BRACKETS = rf"\((?P<body>(?:{_TEXT}|[^()']|\([^()]*\))*+)\)"
_CREATE = re.compile(rf"CREATE TABLE{_CALLED}{_IN_BRACKETS}", re.IGNORECASE)
_INSERT = re.compile(rf"INSERT INTO{_CALLED}(?:\((?P<names>[^()]*)\)\s*)?VALUES\s*", re.IGNORECASE)
_ROW = re.compile(rf"\s*\((?P<body>(?:{_TEXT}|[^()'])*+)\)\s*[,;]?")
_COPY = re.compile(rf"COPY{_CALLED}\((?P<names>[^()]*)\) FROM stdin;\r?\n(?P<rows>.*?)^\\\.", re.I | re.M | re.S)
_NO_COLUMN = re.compile(r"\s*(PRIMARY|UNIQUE|KEY|INDEX|CONSTRAINT|FOREIGN|CHECK|FULLTEXT)\b", re.IGNORECASE)


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """A table of a dump. Raises LogError where none holds rows, or several do and none has a speed."""
    return _chosen(_dumped(path.read_text(encoding="utf-8-sig", errors="replace")), name, columns)


def of_sqlite(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """A table of a file of SQLite, which is only read. Raises LogError as `_read`."""
    found: Tables = {}
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)) as held:
        for (table,) in held.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall():
            rows = held.execute(f'SELECT * FROM "{table.replace(chr(34), chr(34) * 2)}"')
            names = [column[0] for column in rows.description]
            found[table] = (names, [list(row) for row in rows])
    return _chosen(found, name, columns)


def _dumped(text: str) -> Tables:
    """The tables of a dump, with their rows."""
    names = {_bare(match["table"]): _columns_of(match["body"]) for match in _CREATE.finditer(text)}
    found: Tables = {}
    for match in _INSERT.finditer(text):
        table = _bare(match["table"])
        listed = [_bare(each) for each in match["names"].split(",")] if match["names"] else names.get(table, [])
        found.setdefault(table, (listed, []))[1].extend(_rows_at(text, match.end()))
    for match in _COPY.finditer(text):
        rows = [
            [None if cell == r"\N" else _value(cell) for cell in row.split("\t")] for row in match["rows"].split("\n")
        ]
        listed = [_bare(each) for each in match["names"].split(",")]
        found.setdefault(_bare(match["table"]), (listed, []))[1].extend(row for row in rows if len(row) == len(listed))
    return found


def _columns_of(body: str) -> list[str]:
    """The names of columns between the brackets of CREATE TABLE."""
    whole = re.sub(rf"{_TEXT}|\([^()]*\)", "", body)
    parts = [part.strip() for part in whole.split(",") if part.strip() and not _NO_COLUMN.match(part)]
    return [_bare(re.split(r"\s", part, maxsplit=1)[0]) for part in parts]


def _rows_at(text: str, at: int) -> Iterator[list[Any]]:
    while (match := _ROW.match(text, at)) is not None:
        cells = next(csv.reader([match["body"].replace("\n", " ")], quotechar="'", skipinitialspace=True))
        yield [None if cell.strip().upper() == "NULL" else _value(cell) for cell in cells]
        at = match.end()
        if text[at - 1] == ";":
            return


def _value(cell: str) -> Any:
    number = number_or_none(cell) if cell.strip() else None
    return cell if number is None else number


def _bare(name: str) -> str:
    """A name without its quotes, and the schema it is of."""
    return re.sub(r"[`\"\[\]]", "", name).strip().rpartition(".")[2]


def _chosen(tables: Tables, name: str, columns: ColumnMap) -> RawTable:
    tables = _joined({key: (names, rows) for key, (names, rows) in tables.items() if len(rows) > 1 and names})
    if columns.variable is not None:
        tables = {key: held for key, held in tables.items() if key == columns.variable}
    if not tables:
        raise EmptyLogError(f"{name}: holds no table with rows{f' called {columns.variable}' * bool(columns.variable)}")
    moved = [key for key, (names, _) in tables.items() if has_speed(names)] or list(tables)
    if len(moved) > 1:
        raise LogError(f"{name}: holds the tables {', '.join(moved)}: name one (`variable` in the column map)")
    names, rows = tables[moved[0]]
    whole = [row for row in rows if len(row) == len(names)]
    held = {key: [row[at] for row in whole] for at, key in enumerate(names)}
    table = table_of_lists(held, {}, name, lambda row: f"row {row + 1} of {moved[0]}")
    if len(whole) < len(rows):
        table.warnings.append(
            f"{name}: {len(rows) - len(whole)} rows of {moved[0]} have other columns, and were left out"
        )
    return table


def _joined(tables: Tables) -> Tables:
    """The tables with what they point at in its place: `signal_id`, where each is one of `signals.id`, as its columns.

    Those that are pointed at are no tables of their own then.
    """
    found, pointed_at = dict(tables), set[str]()
    for key in tables:
        for other, (columns, entries) in tables.items():
            names, rows = found[key]
            at = next((i for i, name in enumerate(names) if name.lower() in _pointers_at(other)), None)
            if other == key or "id" not in columns or at is None:
                continue
            by_id = {entry[columns.index("id")]: entry for entry in entries if len(entry) == len(columns)}
            if len(by_id) < len(entries) or not all(len(row) > at and row[at] in by_id for row in rows):
                continue
            rest = [i for i, name in enumerate(columns) if name != "id"]
            held = [[*row[:at], *(by_id[row[at]][i] for i in rest), *row[at + 1 :]] for row in rows]
            found[key] = ([*names[:at], *(columns[i] for i in rest), *names[at + 1 :]], held)
            pointed_at.add(other)
    return {key: held for key, held in found.items() if key not in pointed_at}


def _pointers_at(table: str) -> set[str]:
    """What a column is called that points at a table: `signal_id` of `signals`."""
    bare = table.lower()
    return {f"{one}{tail}" for one in (bare, bare.removesuffix("s"), bare.removesuffix("es")) for tail in ("_id", "id")}


SQLITE = foreign_format(
    "a database of SQLite",
    lambda head, suffix: head.startswith(b"SQLite format 3\0") and suffix != ".db3",  # of a bag, as a rule
    "the first bytes of SQLite, not called .db3",
    of_sqlite,
)
FORMAT = foreign_format(
    "an SQL dump", lambda head, suffix: bool(_BEGIN.match(head)), "a first statement CREATE TABLE or INSERT INTO", _read
)
