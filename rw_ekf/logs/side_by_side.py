"""Columns that belong together otherwise than a table says: tables side by side, and rows of other times in one.

Each of several tables beside one another begins with its own time. With the same names they are runs, one after the
other; with others, channels of other rates, which are put on the times of that with the speed.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.logs.column_names import role_of, stated_by
from rw_ekf.logs.interleaved import has_speed
from rw_ekf.logs.last_known import held_at, on_one_axis
from rw_ekf.logs.raw_table import RawTable, taken

_TOGETHER = 0.5  # of the values of a column stand in rows of the speed where it was sampled with it
_LEAST_VALUES = 10  # of a slow channel
_UNEVEN = 5.0  # times the usual gap between its values, at most
_DRIVES = ("current", "current_set", "torque", "force", "voltage")
_SLOW = ("temperature", "pressure", "bus_voltage")


def without_empty_rows(table: RawTable) -> RawTable:
    """The table without rows that hold nothing at all, where a column gives the time of the others or counts them."""
    clocks = [number for number, name in enumerate(table.names) if role_of(stated_by(name)) in ("time", "count")]
    empty = _is_empty(table, clocks[0]) if clocks else np.zeros(0, dtype=np.bool_)
    if not empty.any():
        return table
    for number in range(len(table.names)):
        empty &= _is_empty(table, number)
    count, kept = int(empty.sum()), np.flatnonzero(~empty)
    if not count or not kept.size:
        return table
    found = table.at_rows(kept)
    first = table.place(int(np.argmax(empty)))
    rows = f"{count} rows without a time or a value were" if count > 1 else "1 row without a time or a value was"
    found.warnings = [*table.warnings, f"{table.path}: {rows} skipped, first at {first}"]
    return found


def _is_empty(table: RawTable, number: int) -> BoolArray:
    """Whether the cells of a column (n,) are empty."""
    if table.is_text(number):
        return np.array([cell is None or not str(cell).strip() for cell in table.cells(number)])
    return np.isnan(table.numbers(number, stamps=True))


def beside_each_other(table: RawTable) -> RawTable | None:
    """Several tables beside each other as one; None for any other table."""
    clocks = [number for number, name in enumerate(table.names) if name and role_of(stated_by(name)) == "time"]
    bare = {_unnumbered(table.names[number]) for number in clocks}
    if len(clocks) > 1 and len(bare) > 1 and (others := _other_times(table, clocks)):
        table.doubts = (*table.doubts, others)
    if len(clocks) < 2 or len(bare) > 1 or any(table.names[: clocks[0]]):
        return None
    blocks = [list(range(*span)) for span in zip(clocks, [*clocks[1:], len(table.names)], strict=True)]
    blocks = [[column for column in block if table.names[column]] for block in blocks]
    if any(len(block) < 2 for block in blocks):
        return None
    times = [table.numbers(block[0]) for block in blocks]
    if not all(map(_rises, times)):
        return None
    named = [[_unnumbered(table.names[column]) for column in block] for block in blocks]
    if all(names == named[0] for names in named):
        return _stacked(table, blocks)
    return _on_one_clock(table, blocks, times)


def _other_times(table: RawTable, clocks: list[int]) -> str:
    """A sentence on times of two devices, `RW1 time`, `RW2 time`, that differ; empty where there are none."""
    first, *rest = clocks
    for other in rest:
        names = table.names[first].split(), table.names[other].split()
        alike = len(names[0]) > 2 and names[0][-2:] == names[1][-2:] and names[0] != names[1]  # but for the device
        if alike and not np.array_equal(table.numbers(first), table.numbers(other), equal_nan=True):
            return f"'{table.names[first]}' and '{table.names[other]}' differ: save a table for each."
    return ""


def _unnumbered(name: str) -> str:
    """A name without the number of its run, which stands at its end or before its unit: `n2`, `n2 [rpm]`."""
    return re.sub(r"(?<=\D)[ _.]?\d+(?=$|\s*[\[(])", "", name)


def in_turn(table: RawTable) -> RawTable | None:
    """A table with what stands at other times than the speed held beside it; None for any other.

    Rows have now the speed and now what drives where topics of different times stand in one table (PlotJuggler, an
    outer join): those of the speed are taken. A slow channel, as a temperature, may have a value in a row of many.
    """
    role = {number: role_of(stated_by(name)) for number, name in enumerate(table.names) if name}
    clocks = [table.numbers(number, stamps=True) for number in role if role[number] == "time"]
    time = next((time for time in clocks if np.isfinite(time).all() and _rises(time)), None)
    values = {number: table.numbers(number) for number in role if role[number] != "time"}
    known = {number: each for number, held in values.items() if (each := np.isfinite(held)).any()}
    speed = max((n for n in known if role[n] == "speed"), key=lambda n: int(known[n].sum()), default=None)
    if time is None or speed is None:
        return None
    base = known[speed]
    held = {n for n, each in known.items() if max(np.mean(base[each]), np.mean(each[base])) < _TOGETHER}
    between = {number for number, each in known.items() if role[number] in _DRIVES and not base[each].all()}
    if not between or not between <= held:
        held, base = set(), np.ones(table.rows, dtype=np.bool_)
    held |= {number for number, each in known.items() if role[number] in _SLOW and _is_slow(each[base])}
    if not held:
        return None
    kept = np.flatnonzero(base)
    axis = on_one_axis(time, np.zeros(len(time), dtype=np.int64))
    time = time if axis is None else axis
    columns = [taken(column, kept) for column in table.columns]
    for number in held:
        columns[number] = held_at(time[kept], time[known[number]], values[number][known[number]])
    found = table.at_rows(kept, columns=columns)
    names = ", ".join(f"'{table.names[number]}'" for number in sorted(held))
    text = f"{table.path}: {names}: not at the times of '{table.names[speed]}'; the last value known was taken at each"
    found.warnings = [*table.warnings, text]
    return found


def _is_slow(known: BoolArray) -> bool:
    """Whether a channel has values in few rows (n,) but all through, one as far from the other as the next."""
    at = np.concatenate(([-1], np.flatnonzero(known), [len(known)]))
    gaps = np.diff(at)
    return _LEAST_VALUES < len(at) < _TOGETHER * len(known) and float(gaps.max()) <= _UNEVEN * float(np.median(gaps))


def _rises(time: Float64Array) -> bool:
    known = time[np.isfinite(time)]
    return known.size > 2 and float(np.mean(np.diff(known) > 0.0)) > 0.98


def _stacked(table: RawTable, blocks: list[list[int]]) -> RawTable:
    """Blocks with the same names as runs under each other, each a segment."""
    rows = [np.flatnonzero(np.isfinite(table.numbers(block[0]))) for block in blocks]
    held: list[Any] = [
        np.concatenate([table.numbers(block[at])[kept] for block, kept in zip(blocks, rows, strict=True)])
        for at in range(len(blocks[0]))
    ]
    held.append(np.repeat(np.arange(len(blocks), dtype=np.float64), [len(kept) for kept in rows]))
    names = (*(table.names[column] for column in blocks[0]), "segment")
    stacked = table.at_rows(np.concatenate(rows), names, held)
    first, *others = (table.numbers(block[0]) for block in blocks)
    at_once = any(np.array_equal(first, other, equal_nan=True) for other in others)
    text = f"{table.path}: has {len(blocks)} tables side by side: each is a run"
    if at_once:
        text += (
            "; if they are wheels that ran at once, which their equal times allow, name the columns of one by number"
        )
    stacked.warnings = [*table.warnings, text]
    return stacked


def _on_one_clock(table: RawTable, blocks: list[list[int]], times: list[Float64Array]) -> RawTable:
    """All columns on the times of the block that has the speed; only where the times differ is anything moved."""
    speeds = [has_speed(table.names[column] for column in block) for block in blocks]
    base = speeds.index(True) if any(speeds) else 0
    kept = np.flatnonzero(np.isfinite(times[base]))
    at = times[base][kept]
    columns, names = [at], [table.names[blocks[base][0]]]
    for block, time in zip(blocks, times, strict=True):
        known = np.isfinite(time)
        same = len(time[known]) == len(at) and bool(np.array_equal(time[known], at))
        for column in block[1:]:
            values = table.numbers(column)
            columns.append(values[kept] if same else held_at(at, time[known], values[known]))
            names.append(table.names[column])
    return table.at_rows(kept, tuple(names), columns)
