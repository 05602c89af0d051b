"""Applies a column map to a raw table: the log columns that come straight from the file, and what is carried along."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.errors import LogError
from rw_ekf.logs.column_map import ColumnMap, Source
from rw_ekf.logs.column_records import stated_in_columns
from rw_ekf.logs.column_words import BACKWARD, FORWARD, STOPPED
from rw_ekf.logs.log_columns import READABLE_COLUMNS
from rw_ekf.logs.odd_columns import faults_of_column
from rw_ekf.logs.raw_table import RawTable, number_or_none
from rw_ekf.logs.row_rules import segment_ids, unwrapped
from rw_ekf.units import rad_s_from_rpm


@dataclass(eq=False)
class MappedColumns:
    """Log columns by name (n,), as read: no row dropped yet, gaps NaN."""

    values: dict[str, Float64Array]
    constant: frozenset[str]  # those of `values` that the map gives as a constant
    position: tuple[Float64Array, Source, str] | None  # what the speed is the derivative of, and the speed's name
    in_rpm: bool = False  # the speed was given in rpm
    sources: dict[str, Source] = field(default_factory=dict)  # where each of `values` came from, and the speed
    faults: list[str] = field(default_factory=list)  # what shows that a column is not what it is taken for
    other: dict[str, Any] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)


def map_columns(table: RawTable, columns: ColumnMap) -> MappedColumns:
    """Pick the log columns out of `table`. Raises LogError if a needed one is missing or holds infinity."""
    mapped = MappedColumns({}, frozenset(n for n, s in columns.sources.items() if s.kind == "constant"), None)
    used: set[int] = set()
    for name, source in columns.sources.items():
        if source.kind == "constant":
            mapped.values[name] = np.full(table.rows, source.constant)
            continue
        index = _find(table, source)
        used.add(index)
        values = _finite(table, index, name, truths=source.scale != 1.0 or source.offset != 0.0)
        if source.missing is not None:
            values[values == source.missing] = np.nan
        mapped.sources[name] = source
        mapped.faults += faults_of_column(table.names[index], name, source, values)
        if source.kind == "derivative":
            mapped.position = (values, source, name)
        else:
            scaled = _scaled(
                table, source, unwrapped(values, source.wrap) if name == "time_s" else _wrapped(values, source.wrap)
            )
            mapped.values[name] = _signed(table, source, scaled, used)
    _take_by_own_name(table, columns, mapped, used)
    _make_time(table, columns, mapped)
    _one_speed(table, mapped)
    _require(table, mapped)
    _carry_along(table, mapped, used)
    return mapped


def _find(table: RawTable, source: Source) -> int:
    column = source.column
    if isinstance(column, int):
        if column < len(table.names):
            return column
        last = len(table.names) - 1
        raise LogError(f"{source.where}: column {column} is not in {table.path}: its columns are 0 to {last}")
    index = table.index_of(str(column))
    if index is None:
        raise LogError(
            f"{source.where}: column '{column}' is not in {table.path}{table.nearest(str(column))}; "
            f"its columns: {table.described_columns()}"
        )
    return index


def _finite(table: RawTable, index: int, name: str, *, truths: bool = False) -> Float64Array:
    """Numbers of the column that is to be `name`; infinity is an error, a gap is NaN.

    truths: whether true and false are taken for 1 and 0, since a map says how much that is; segments may always be so.
    """
    if not truths and name != "segment" and table.is_truth(index):
        raise LogError(
            f"{table.path}: column '{table.names[index]}' holds true and false, not numbers: convert it to a number in "
            "the unit that its name says"
        )
    values = table.floats(index, stamps=name == "time_s")
    infinite = np.isinf(values)
    if infinite.any():
        row = int(np.argmax(infinite))
        name = f"column '{table.names[index]}'" if table.names[index] else f"column {index}"
        raise LogError(
            f"{table.path}: {table.place(row)}, {name}: {values[row]} is not a finite number: leave the cell empty for "
            "a gap"
        )
    return values


def _wrapped(values: Float64Array, wrap: float) -> Float64Array:
    """Numbers that count modulo `wrap`, around zero; 0: they do not."""
    return np.asarray((values + 0.5 * wrap) % wrap - 0.5 * wrap) if wrap else values


def _scaled(table: RawTable, source: Source, values: Float64Array) -> Float64Array:
    """Apply scale and offset; without them the values stay bit for bit what they were."""
    if source.scale == 1.0 and source.offset == 0.0:
        return values
    with np.errstate(over="ignore"):
        scaled = source.scale * values + source.offset
    if np.isinf(scaled).any():
        place = table.place(int(np.argmax(np.isinf(scaled))))
        raise LogError(f"{source.where}: scale and offset make {table.path}, {place}, too large for a number")
    return np.asarray(scaled)


def _signed(table: RawTable, source: Source, values: Float64Array, used: set[int]) -> Float64Array:
    """A magnitude with the sign of the column that the map names for it; against it where its scale is negative."""
    if source.sign_of is None:
        return values
    index = _find(table, replace(source, column=source.sign_of))
    used.add(index)
    return np.asarray(np.copysign(1.0, source.scale) * np.abs(values) * _signs_of(table, index))


def _signs_of(table: RawTable, index: int) -> Float64Array:
    """Signs (n,) of directions: of numbers (of two that are not negative, the lower is -1), or of words.

    Raises LogError for what is neither.
    """
    if not table.is_text(index):
        values = table.floats(index)
        known = np.unique(values[np.isfinite(values)])
        if known.size == 2 and known[0] >= 0.0:
            return np.where(np.isnan(values), np.nan, np.where(values == known[1], 1.0, -1.0))
        return np.asarray(np.sign(values))
    words = [None if value is None else str(value).strip().lower() for value in table.columns[index].to_pylist()]
    signs = {word: 1.0 if word in FORWARD else -1.0 for word in set(words) if word in FORWARD | BACKWARD}
    if signs.keys() & {"l", "f", "fwd", "forward"}:  # R is right beside L, reverse beside F, and anything else alone
        signs["r"] = 1.0 if "l" in signs else -1.0
    if len(set(signs.values())) == 2:
        words = _before_a_stop(words, signs.keys())
    odd = next((word for word in words if word and word not in signs), None)
    if odd is not None:
        raise LogError(
            f"{table.path}: column '{table.names[index]}' is to be a direction and says {odd!r}: "
            "forward or reverse, CW or CCW, 1 or -1"
        )
    return np.array([np.nan if not word else signs[word] for word in words])


def _before_a_stop(words: list[str | None], directions: Collection[str]) -> list[str | None]:
    """Words of directions, those of a stop as the one before: a wheel that coasts turns on as it did, or stands."""
    last = next((word for word in words if word in directions), None)
    found = []
    for word in words:
        last = word if word in directions else last
        found.append(last if word in STOPPED - {*directions} else word)
    return found


def _take_by_own_name(table: RawTable, columns: ColumnMap, mapped: MappedColumns, used: set[int]) -> None:
    """Columns that bear the log's own names need no mapping."""
    factors = {**stated_in_columns(table)[1], **table.factors}
    speed_is_mapped = any(name.startswith("speed_") for name in columns.sources)
    for name in READABLE_COLUMNS:
        if name in columns.sources or (speed_is_mapped and name.startswith("speed_")):
            continue
        index = table.index_of(name)
        if index is not None and index not in used and not (name == "status" and table.is_text(index)):
            used.add(index)
            source = Source("column", name)
            mapped.sources[name], mapped.values[name] = source, _finite(table, index, name)
            mapped.faults += faults_of_column("", name, source, mapped.values[name])
            text = factors[name].factor if name in factors else ""
            if text and (scale := number_or_none(text.partition(" in ")[0])) != 1.0:
                line = source.line(name, scale=scale) if scale and np.isfinite(scale) else "`scale`"
                mapped.warnings.append(
                    f"{table.path}: {name} is taken as its name says, and beside it stands a factor, {text}: if its "
                    f"numbers are still to be multiplied by that, a column map says so: {line}"
                )


def _make_time(table: RawTable, columns: ColumnMap, mapped: MappedColumns) -> None:
    """Give time by the row number where the map gives a rate; it starts from 0 in each segment."""
    if columns.rate_hz is None:
        return
    if "time_s" in mapped.values:
        mapped.warnings.append(f"{table.path}: column time_s is ignored: {columns.path} gives rate_hz")
    row = np.arange(table.rows, dtype=np.float64)
    if "segment" in mapped.values:
        ids = segment_ids(mapped.values["segment"])
        row = row - np.searchsorted(ids, ids)
    mapped.values["time_s"] = row / columns.rate_hz


def _one_speed(table: RawTable, mapped: MappedColumns) -> None:
    """Leave one speed, in rad/s."""
    rpm = mapped.values.pop("speed_rpm", None)
    if rpm is None:
        return
    if "speed_rad_s" in mapped.values:
        mapped.warnings.append(f"{table.path}: has speed_rad_s and speed_rpm; speed_rad_s is used")
        mapped.other["speed_rpm"] = rpm
    else:
        rpm *= rad_s_from_rpm(1.0)
        mapped.values["speed_rad_s"] = rpm
        mapped.in_rpm = True


def _require(table: RawTable, mapped: MappedColumns) -> None:
    has = mapped.values
    for name, present, what in (
        ("time_s", "time_s" in has, "time_s"),
        ("speed_rad_s", "speed_rad_s" in has or mapped.position is not None, "speed_rad_s or speed_rpm"),
        ("current_command_A", "current_command_A" in has or "current_A" in has, "current_command_A or current_A"),
    ):
        if not present:
            raise LogError(
                f"{table.path}: column {what} is missing{table.nearest(name)}; columns: {table.described_columns()}. "
                f"Say which column it is with --columns map.yaml{_layout_hint(table)}"
            )


def _layout_hint(table: RawTable) -> str:
    """What else may be wrong when nothing is found."""
    if all(not name for name in table.names):
        return " (there is no header row: columns go by number there)"
    if len(table.names) == 1:
        for delimiter, shown in ((";", '";"'), ("\t", '"\\t"'), ("|", '"|"'), (" ", '" "')):
            if delimiter in table.names[0]:
                return f" (its delimiter seems to be {shown}: `delimiter: {shown}` in the map)"
    return ""


def _carry_along(table: RawTable, mapped: MappedColumns, used: set[int]) -> None:
    for index, name in enumerate(table.names):
        if index in used or name in mapped.values:
            continue
        if name in mapped.other or name in table.names[:index]:
            mapped.warnings.append(
                f"{table.path}: column {index} ('{name}') is not carried along: the name is repeated"
            )
        elif name:
            mapped.other[name] = table.columns[index]
