"""Rows of several kinds under each other, made rows of one: a row a signal, or packets of a telemetry stream in turn.

What the other kinds said last is held beside each row of one kind: of that which has the speed, or else of the most
frequent. Nothing is interpolated, and nothing known later stands beside what was measured before.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.logs.channel_blocks import kind_of
from rw_ekf.logs.column_names import role_of, stated_by
from rw_ekf.logs.column_units import unit_of, with_unit
from rw_ekf.logs.raw_table import Factor, RawTable, number_or_none, taken

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
    """Rows of the base kind with what the others said last, and where they stand among the records."""
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
    others: dict[str, Any] = {}
    found, places = [], []
    for place, (kind, record) in enumerate(records):
        others |= {name: value for name, value in record.items() if name not in own}
        if kind in alike:
            found.append({**others, **record})
            places.append(place)
    return found, places


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
    rows = np.flatnonzero([cell == base for cell in cells]).astype(np.int64)
    columns = [taken(table.columns[column], rows) for column in rest]
    columns += [value[rows] if kind == base else _last(cells, kind, value, rows) for kind in kinds]
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
    """The last value (m,) of a kind at each of the rows (m,); NaN before the first.

    At the time of a row itself its own come later by an order of writing that means nothing, so the next few count too.
    """
    own = np.flatnonzero([cell == kind for cell in cells])
    ends = np.append(rows[1:], len(cells)) - 1  # what stands before the next row of the base is of this one's moment
    at = np.searchsorted(own, np.minimum(ends, rows + len(set(cells)) - 1), side="right") - 1
    found = value[own[np.maximum(at, 0)]]
    found[at < 0] = np.nan
    return np.asarray(found, dtype=np.float64)
