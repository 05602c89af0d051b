"""Files that hold several groups (topics, messages) of different rates: one of them, or all on the times of one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.errors import EmptyLogError, LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.last_known import held_at
from rw_ekf.logs.log_columns import READABLE_COLUMNS
from rw_ekf.logs.raw_table import MAX_NAMES_SHOWN, RawTable
from rw_ekf.logs.vectors import vector_of
from rw_ekf.logs.which_wheel import of_wheel

OWN_COLUMNS = {"time_s", "command_delay_s", "segment"}  # what every log of this program has, and nobody else's
_CLOCKS = ("time_s", "clock_s")  # what a group's time is called: the second where a channel has the first name


@dataclass(eq=False)
class Group:
    """Channels that were sampled together, n times."""

    name: str
    time_s: Float64Array | None  # (n,) [s]; None: the file has no time for them
    channels: dict[str, Any]  # (n,) each, as they are in the file: those that are no numeric vectors are left out
    units: dict[str, str] = field(default_factory=dict)  # by channel, as far as the file has them
    remarks: dict[str, str] = field(default_factory=dict)  # by channel: what the file says of it in prose

    def __post_init__(self) -> None:
        vectors = {channel: vector_of(values) for channel, values in self.channels.items()}
        self.channels = {channel: values for channel, values in vectors.items() if values is not None}

    @property
    def rows(self) -> int:
        """How many times it was sampled."""
        if self.time_s is not None:
            return len(self.time_s)
        return max(map(len, self.channels.values()), default=0)


def table_of_groups(groups: list[Group], columns: ColumnMap, name: str) -> RawTable:
    """The group that the map's `variable` names; else a log of this program; else the only one; else all joined.

    Of groups of several wheels those of the map's `wheel` alone. All are put on the times of the one with most rows.
    Joined, a column is called `group.channel` and has at each time the last value known by then, NaN before the first.
    What is joined are the columns that the map requires; all of them where one that it requires is not there.
    Raises LogError if `variable` names no group, EmptyLogError if no group holds a number.
    """
    groups = _distinct([group for group in groups if group.rows and group.channels])
    if columns.wheel is not None and (its := of_wheel((group.name for group in groups), columns.wheel)):
        of_it = [group for group in groups if group.name in its]
        logs = [group.name for group in of_it if group.channels.keys() >= OWN_COLUMNS]
        if len(logs) > 1 and columns.variable is None:
            raise LogError(f"{name}: holds several logs of '{columns.wheel}', {_shown(logs)}: name one by its run")
        table = table_of_groups(of_it, replace(columns, wheel=None), name)
        table.one_wheel = True
        return table
    shown = _shown([group.name for group in groups])
    if columns.variable is not None:
        chosen = [group for group in groups if group.name == columns.variable]
        if not chosen:
            raise LogError(f"{name}: has no '{columns.variable}' (`variable` in the column map); it holds {shown}")
        return _table(name, _alone(chosen[0]), chosen[0])
    if not groups:
        raise EmptyLogError(f"{name}: holds no numbers: nothing was logged")
    own = [group for group in groups if group.channels.keys() >= OWN_COLUMNS]
    if len(own) == 1 and all(column is None or column in own[0].channels for column in _wanted(columns)):
        return _table(name, _of_all_rows(own[0]), own[0])  # its own time is the one that counts, not when it was sent
    if len(groups) == 1:
        return _table(name, _alone(groups[0]), groups[0])
    timed = [group for group in groups if group.time_s is not None]
    if not timed:
        raise LogError(f"{name}: holds {shown}, none with a time: name one (`variable` in the column map)")
    base = max(timed, key=lambda group: group.rows)
    table = _table(name, _joined(timed, base, columns), base)
    table.units = {f"{group.name}.{key}": unit for group in timed for key, unit in group.units.items()}
    table.remarks = {f"{group.name}.{key}": text for group in timed for key, text in group.remarks.items()}
    table.warnings.append(
        f"{name}: holds {shown}: all were put on the times of '{base.name}', the last value known at each; `variable` "
        "in the column map takes one alone"
    )
    untimed = [group.name for group in groups if group.time_s is None]
    if untimed:
        table.warnings.append(f"{name}: {_shown(untimed)} have no time and were left out")
    return table


def channels_of(rows: Sequence[Mapping[str, float]]) -> dict[str, Float64Array]:
    """Channels (n,) of n messages, in the order in which they first appear; NaN where a message has none of it."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row.get(name, np.nan) for row in rows], dtype=np.float64) for name in names}


def seconds_of(ticks: Sequence[int], per_second: int) -> Float64Array:
    """Times (n,) [s] of a clock that counts so many ticks a second, each the nearest number to it."""
    return np.array([tick / per_second for tick in ticks], dtype=np.float64)


def _distinct(groups: list[Group]) -> list[Group]:
    """Give groups of one name a number each, from 0: `name[1]`."""
    repeated = {name for name, count in Counter(group.name for group in groups).items() if count > 1}
    numbers: Counter[str] = Counter()
    for group in groups:
        if group.name in repeated:
            numbers[group.name] += 1
            group.name = f"{group.name}[{numbers[group.name] - 1}]"
    return groups


def _alone(group: Group) -> dict[str, Any]:
    clock = {} if group.time_s is None else {_clock(group.channels): group.time_s}
    return {**clock, **_of_all_rows(group)}


def _of_all_rows(group: Group) -> dict[str, Any]:
    return {key: values for key, values in group.channels.items() if len(values) == group.rows}


def _joined(groups: list[Group], base: Group, columns: ColumnMap) -> dict[str, Any]:
    """Columns of all groups on the times of `base`, the base's own as they are."""
    assert base.time_s is not None
    places = {f"{g.name}.{key}": (g, key) for g in groups for key in g.channels if len(g.channels[key]) == g.rows}
    clock = _clock(places)
    wanted = [column for column in _wanted(columns) if column is not None]
    every = not wanted or any(column != clock and column not in places for column in wanted)
    joined: dict[str, Any] = {clock: base.time_s}
    for name, (group, key) in places.items():
        if group is base:
            joined[name] = group.channels[key]
        elif (every or name in wanted or key in READABLE_COLUMNS) and group.time_s is not None:
            joined[name] = held_at(base.time_s, group.time_s, group.channels[key])
    return joined


def _wanted(columns: ColumnMap) -> list[str | int | None]:
    return [column for source in columns.sources.values() for column in (source.column, source.sign_of)]


def _clock(taken: dict[str, Any]) -> str:
    return next((name for name in _CLOCKS if name not in taken), "clock of the file")


def _shown(names: list[str]) -> str:
    """Names for a message: `3 groups (a, b, c)`."""
    rest = len(names) - MAX_NAMES_SHOWN
    more = f" and {rest} more" if rest > 0 else ""
    return f"{len(names)} group{'' if len(names) == 1 else 's'} ({', '.join(names[:MAX_NAMES_SHOWN]) or 'none'}{more})"


def _table(name: str, columns: dict[str, Any], base: Group) -> RawTable:
    held = list(columns.values())
    table = RawTable(name, tuple(columns), held, base.rows, lambda row: f"row {row + 1}")
    table.units, table.remarks = base.units, base.remarks
    return table
