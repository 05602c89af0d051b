"""Rows of several kinds under each other, made rows of one: a row a signal, or packets of a telemetry stream in turn.

What the other kinds reported last is held beside each row of one kind: of that which has the speed, or else of the most
frequent. Nothing is interpolated, and nothing known later stands beside what was measured before: last is by the time
of the rows, in whatever order they are, and by their order only where no time distinguishes one row from the next.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence, Set
from typing import Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array
from rw_ekf.logs.channel_blocks import kind_of
from rw_ekf.logs.column_names import role_of, stated_by
from rw_ekf.logs.column_units import unit_of, with_unit
from rw_ekf.logs.last_known import held_at, last_known, on_one_axis
from rw_ekf.logs.raw_table import Factor, RawTable, number_or_none, taken
from rw_ekf.logs.time_text import seconds_of
from rw_ekf.logs.which_wheel import MOST_WHEELS, TELLING

_MOST_KINDS = 60  # signals of one file
_LEAST_NAMES = 2  # between the numbers of a row
_LEAST_ROWS = 10  # of a signal, on average
_VALUE = frozenset(
    ["value", "val", "values", "wert", "valeur", "valor", "measurement", "reading", "data", "eng", "engineering"]
)


def has_speed(names: Iterable[str]) -> bool:
    """Whether one of these is a speed's name."""
    return any(role_of(stated_by(name)) == "speed" for name in names)


def base_kind(names: Mapping[str, Sequence[str]], rows: Mapping[str, int]) -> str:
    """Which kind of rows the others are put beside. names: what each kind holds; rows: how many there are of each."""
    return max(rows, key=lambda kind: (has_speed(names[kind]), rows[kind]))


def held(records: Sequence[tuple[str, Mapping[str, Any]]]) -> tuple[list[dict[str, Any]], list[int]]:
    """Rows of the base kind with what the others reported last, and where they stand among the records."""
    kinds: dict[str, dict[str, None]] = {}
    rows = Counter(kind for kind, _ in records)
    for kind, record in records:
        kinds.setdefault(kind, {}).update({name: None for name, value in record.items() if value is not None})
    base = base_kind({kind: list(names) for kind, names in kinds.items()}, rows)
    own = kinds[base].keys()
    alike = {  # a row that lacks a value, or has one more than most, is one of the base all the same
        kind
        for kind, names in kinds.items()
        if names.keys() >= own
        or (names.keys() <= own and has_speed(names) == has_speed(own) and 2 * len(names) > len(own))
    }
    places = [place for place, (kind, _) in enumerate(records) if kind in alike]
    if (time_s := _times_of(records, alike)) is not None:
        return _held_by_time(records, time_s, places, own), places
    others: dict[str, Any] = {}
    found = []
    for kind, record in records:
        others |= {name: value for name, value in record.items() if name not in own}
        if kind in alike:
            found.append({**others, **record})
    return found, places


def _times_of(records: Sequence[tuple[str, Mapping[str, Any]]], alike: Set[str]) -> Float64Array | None:
    """When records (n,) are from, on one axis; None where no name of all of them says it, or not to the row.

    alike: the kinds whose rows the others are put beside.
    """
    is_base = np.array([kind in alike for kind, _ in records])
    codes = _codes(["" if kind in alike else kind for kind, _ in records])
    for name in records[0][1]:
        if role_of(stated_by(name)) != "time" or not all(name in record for _, record in records):
            continue
        time_s = _seconds([record[name] for _, record in records])
        if time_s is not None and (found := _axis(time_s, codes, is_base)) is not None:
            return found
    return None


def _codes(kinds: Sequence[str]) -> Int64Array:
    """A number for each of the kinds of rows (n,), from 0."""
    return np.unique(kinds, return_inverse=True)[1].astype(np.int64)


def _axis(time_s: Float64Array, codes: Int64Array, is_base: BoolArray) -> Float64Array | None:
    """Times of rows (n,) of several kinds on one axis; None where none is, or two rows of the base have the same."""
    found = on_one_axis(time_s, codes)
    return found if found is not None and np.all(np.diff(np.sort(found[is_base])) > 0.0) else None


def _held_by_time(
    records: Sequence[tuple[str, Mapping[str, Any]]], time_s: Float64Array, places: list[int], own: Set[str]
) -> list[dict[str, Any]]:
    """Rows at some places, each with what the other records reported last at its time (n,). own: names of the rows."""
    others: dict[str, list[int]] = {}
    for place, (_, record) in enumerate(records):
        for name in record.keys() - own:
            others.setdefault(name, []).append(place)
    found: list[dict[str, Any]] = [{} for _ in places]
    for name, of_it in others.items():
        for row, which in zip(found, last_known(time_s[places], time_s[of_it]), strict=True):
            if which >= 0:
                row[name] = records[of_it[which]][1][name]
    return [{**row, **records[place][1]} for row, place in zip(found, places, strict=True)]


def _seconds(cells: Sequence[Any]) -> Float64Array | None:
    """Times (n,) of numbers or stamps [s, or whatever the numbers are in]; None where some cell is neither."""
    numbers = [number_or_none(str(cell)) for cell in cells]
    known = [number for number in numbers if number is not None]
    return np.array(known) if len(known) == len(cells) else seconds_of([str(cell) for cell in cells])


def widened(table: RawTable) -> RawTable | None:
    """A table with a row a signal (time, name, value) as one with a column a signal; None for any other table.

    A column that has one unit for each signal says what it is in. Signals of words alone are left out.
    """
    texts = [number for number in range(len(table.names)) if table.is_text(number)]
    values = [number for number, name in enumerate(table.names) if stated_by(name).words & _VALUE]
    if not any(table.names):
        values = [number for number in range(len(table.names)) if table.is_plain_number(number)]
    values = [number for number in values if number not in texts] or values
    if len(values) != 1:
        return None
    value = _numbers(table, values[0])
    signals = {number: list(map(_filled, table.cells(number))) for number in texts if number != values[0]}
    stated = {number: set(cells) for number, cells in signals.items() if _are_signals(cells)}
    of_units = {number for number, cells in stated.items() if all(not cell or unit_of(cell) for cell in cells)}
    if len(stated.keys() - of_units) != 1 or np.isnan(value).all():
        return None
    number = next(iter(stated.keys() - of_units))
    cells = signals[number]
    numeric = {cell for cell, known in zip(cells, np.isfinite(value), strict=True) if known}
    rows = np.flatnonzero([cell in numeric for cell in cells]).astype(np.int64)
    units = _unit_of_each(cells, [signals[other] for other in signals if other != number])
    if units is None:
        return None
    names = [with_unit(cells[row], units.get(cells[row], "")) for row in rows]
    rest = [column for column in range(len(table.names)) if column not in (number, values[0])]
    scaling = {kind: column for column in rest if (kind := kind_of(table.names[column])) in ("factor", "offset")}
    wide = _wide(table.at_rows(rows), names, value[rows], [column for column in rest if column not in scaling.values()])
    if wide is not None and scaling:
        held = {kind: table.cells(column) for kind, column in scaling.items()}
        wide.factors = {name: _factor_at(rows[[other == name for other in names]], held) for name in {*names}}
    return wide


def named_between(table: RawTable) -> RawTable | None:
    """A table without names whose columns each stand behind a word that never changes, which is its name.

    `VEL_CMD,-15.6,M1_ENC,1637`, in each row. None for any other table.
    """
    count = len(table.names)
    words = [number for number in range(count) if not any(table.names) and table.is_text(number)]
    held = {number: found[0] for number in words if (found := table.distinct(number, 1))}
    stated = {number + 1: word.strip(" :=") for number, word in held.items()}
    if len(stated) < _LEAST_NAMES or held.keys() & stated.keys() or count in stated:
        return None
    kept = [number for number in range(count) if number not in held]
    names = tuple(stated.get(number, "") for number in kept)
    return table.at_rows(np.arange(table.rows), names, [table.columns[number] for number in kept])


def _factor_at(rows: Int64Array, held: Mapping[str, list[Any]]) -> Factor:
    """What cells say of a signal in its rows (m,): no number where it changes."""
    texts = {kind: "/".join(dict.fromkeys(str(cells[row]) for row in rows)) for kind, cells in held.items()}
    return Factor(texts.get("factor", ""), texts.get("offset", ""))


def _wide(table: RawTable, cells: list[str], value: Float64Array, rest: list[int]) -> RawTable | None:
    """Rows of named values (n,) as a table with a column a name, and the other columns `rest` as they are."""
    kinds = list(dict.fromkeys(cells))
    if len(kinds) < 2:
        return None
    base = base_kind({kind: [kind] for kind in kinds}, Counter(cells))
    is_base = np.array([cell == base for cell in cells])
    rows = np.flatnonzero(is_base).astype(np.int64)
    columns = [taken(table.columns[column], rows) for column in rest]
    times = _times(table, _codes(cells), is_base, rest)

    def last(kind: str) -> Float64Array:
        if times is None:
            return _last(cells, kind, value, rows)
        own = np.flatnonzero([cell == kind for cell in cells])
        return held_at(times[rows], times[own], value[own])

    columns += [value[rows] if kind == base else last(kind) for kind in kinds]
    wide = table.at_rows(rows, (*(table.names[column] for column in rest), *kinds), columns)
    wide.warnings = [
        *table.warnings,
        f"{table.path}: has a row for each of {len(kinds)} signals ({', '.join(kinds[:8])}): put beside each other at "
        f"the times of '{base}', the last value known at each",
    ]
    return wide


def _filled(cell: Any) -> str:
    """A cell of words, empty where nothing stands in it."""
    return "" if cell is None or cell == "nan" else str(cell)


def _numbers(table: RawTable, number: int) -> Float64Array:
    """The numbers (n,) of a column that may hold words between them, as `true` or a name: NaN there."""
    if not table.is_text(number):
        return table.numbers(number)
    found = (number_or_none(str(cell)) for cell in table.cells(number))
    return np.array([np.nan if each is None else each for each in found], dtype=np.float64)


def _unit_of_each(cells: list[str], others: list[list[str]]) -> dict[str, str] | None:
    """The unit of each signal, where another column has units; None where that of one signal changes."""
    for other in others:
        pairs = set(zip(cells, other, strict=True))
        found = {cell: unit for cell, unit in pairs if unit}
        if found and all(unit_of(unit) for _, unit in pairs if unit):
            return found if len(pairs) == len(set(cells)) else None
    return {}


def _are_signals(cells: list[str]) -> bool:
    counts = Counter(cells)
    speeds = any(role_of(stated_by(cell)) in ("speed", "angle") for cell in counts)
    return "" not in counts and 1 < len(counts) <= _MOST_KINDS and len(cells) >= _LEAST_ROWS * len(counts) and speeds


def _last(cells: list[Any], kind: Any, value: Float64Array, rows: Int64Array) -> Float64Array:
    """The last value (m,) of a kind at each of the rows (m,) by the order of the file; NaN before the first.

    At the time of a row itself its own come later by an order of writing that means nothing, so the next few count too.
    """
    own = np.flatnonzero([cell == kind for cell in cells])
    ends = np.append(rows[1:], len(cells)) - 1  # what stands before the next row of the base is of this one's moment
    at = np.searchsorted(own, np.minimum(ends, rows + len(set(cells)) - 1), side="right") - 1
    found = value[own[np.maximum(at, 0)]]
    found[at < 0] = np.nan
    return np.asarray(found, dtype=np.float64)


def _times(table: RawTable, codes: Int64Array, is_base: BoolArray, rest: Sequence[int]) -> Float64Array | None:
    """When the rows (n,) of named values are from, on one axis; None where no column gives it to the row.

    codes: what each is a value of; rest: the other columns. Without names whatever rises in the rows of each is a time.
    """
    if any(TELLING.search(table.names[column]) and len(table.distinct(column, MOST_WHEELS)) > 1 for column in rest):
        return None  # of several wheels: one's values are not the other's
    for column in rest:
        time_s = table.numbers(column, stamps=True)
        if any(table.names):
            is_time = role_of(stated_by(table.names[column])) == "time"
        else:
            is_time = all(np.all(np.diff(time_s[codes == code]) >= 0.0) for code in range(int(codes.max()) + 1))
        if is_time and (found := _axis(time_s, codes, is_base)) is not None:
            return found
    return None
