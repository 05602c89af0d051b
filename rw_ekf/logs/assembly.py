"""From the columns of a table to a log: the rules for rows, of a whole log, or of one that comes in parts."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array
from rw_ekf.errors import LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.log_columns import CHANNELS
from rw_ekf.logs.mapping import MappedColumns, map_columns
from rw_ekf.logs.odd_columns import clock_set_back
from rw_ekf.logs.raw_table import RawTable
from rw_ekf.logs.row_rules import (
    backward_difference,
    block_means,
    decimated_rows,
    from_next_row,
    held_current,
    new_rows,
    restarted,
    rows_in_order,
    segment_ids,
    spread_stamps,
)
from rw_ekf.logs.wheel_log import Drive, WheelLog
from rw_ekf.units import rad_s_from_rpm

MAX_SKIPPED_SHARE = 0.01
_GAPS_UNSAID = 0.01  # of the rows: a run misses a reply now and then
_CURRENTS = ("current_command_A", "current_A")
_MOST_BEFORE = 16_384  # rows that a part begins with of the one before


@dataclass
class RowTally:
    """What was mended in the rows of a log."""

    rows: int = 0  # of the file
    kept: int = 0
    skipped: int = 0
    first_skipped: str = ""  # its place
    clock: str | None = None  # the sentence on one that was set back
    leading: int = 0  # rows before the first current of their segment
    held: int = 0  # rows without a current, which continue with the one before

    def skipped_rows(self, path: str) -> list[str]:
        """A sentence on the rows that were skipped, if any. Raises LogError if they are too many to be an accident."""
        if not self.skipped:
            return []
        share = self.skipped / self.rows
        rows = f"{self.skipped} of {self.rows} rows" if self.skipped > 1 else f"1 of {self.rows} rows"
        if share > MAX_SKIPPED_SHARE and self.clock is not None:
            raise LogError(f"{path}: {self.clock}")
        if share > MAX_SKIPPED_SHARE:
            raise LogError(
                f"{path}: {rows} ({100 * share:.1f} %) repeat a time or go backward, first at {self.first_skipped}; "
                f"above {100 * MAX_SKIPPED_SHARE:g} % this is no accident: sort the log by time, or give a `segment` "
                "column that changes where time restarts"
            )
        return [f"{path}: {rows} repeat a time or go backward and were skipped, first at {self.first_skipped}"]

    def gaps(self, path: str, name: str) -> list[str]:
        """Sentences on what was taken where column `name` has no current."""
        stated = []
        if self.leading:
            rows = "1 row" if self.leading == 1 else f"{self.leading} rows"
            stated.append(f"{path}: no {name} in {rows} at the start of a segment; 0 A was taken there")
        if self.held > _GAPS_UNSAID * self.kept:
            stated.append(f"{path}: no {name} in {self.held} of {self.kept} rows; the value before was held there")
        return stated


class Assembly:
    """Makes logs of the tables of one log: of the only one, or of one after another, which makes the same rows."""

    def __init__(self, columns: ColumnMap, carried: Collection[str] | None = None) -> None:
        """carried: names of columns that the log needs of those which it does not know; None: all of them."""
        self.tally = RowTally()
        self._columns, self._carried = columns, carried
        self._stated: list[str] = []  # of the first table, and on the column of the current
        self._drive: tuple[str, Drive] | None = None  # the column, and what it is

    def whole(self, table: RawTable) -> WheelLog:
        """The log of a table that is all of it. Raises LogError as `read_log`."""
        log, _, _ = self.part(table, None, 0)
        warnings = self.warnings(table.path)
        if len(log) == 1:
            warnings.append(f"{table.path}: holds only one sample")
        if np.isnan(log.speed_rad_s).all():
            warnings.append(f"{table.path}: holds no speed: the column is empty throughout")
        return replace(log, warnings=tuple(warnings))

    def warnings(self, path: str) -> list[str]:
        """What was mended in the rows so far. Raises LogError where that is too much to be an accident."""
        of_table, of_drive = self._stated[:-1], self._stated[-1:]
        name = "" if self._drive is None else self._drive[0]
        return [*of_table, *self.tally.skipped_rows(path), *filter(None, of_drive), *self.tally.gaps(path, name)]

    def part(self, table: RawTable, before: Rows | None, keep_s: float) -> tuple[WheelLog, int, Rows]:
        """The log of the next table, behind rows `before` of the one before it, and how many these are.

        And what the part after it has to begin with: the rows of the last `keep_s`. The log has no warnings of its own.
        """
        columns, tally = self._columns, self.tally
        mapped = map_columns(table, columns)
        if before is None:
            self._stated = [*table.warnings, *mapped.warnings]
        begin = 0 if before is None else before.rows
        if before is not None:
            table, mapped = _behind(before, table, mapped)
        time_s = mapped.values["time_s"]
        _all_present(table, time_s, "time_s", "every row needs its time")
        if columns.restarts and "segment" not in mapped.values:
            mapped.values["segment"] = restarted(time_s)
        segment = _segments(table, mapped)
        if columns.repeats == "spread":
            time_s = mapped.values["time_s"] = spread_stamps(time_s, segment)
        keep = self._rows_to_keep(table, mapped, segment)
        rows: Any = slice(None) if keep.all() else np.flatnonzero(keep)
        values = {name: array[rows] for name, array in mapped.values.items()}
        position = None if mapped.position is None else mapped.position[0][rows]
        segment = segment[rows]
        if columns.current_before:
            values |= {name: from_next_row(values[name], segment) for name in _CURRENTS if name in values}
        if columns.decimate > 1:
            starts = decimated_rows(segment, columns.decimate)
            values = {
                name: block_means(array, starts) if name in _CURRENTS else array[starts]
                for name, array in values.items()
            }
            position = None if position is None else position[starts]
            segment = segment[starts]
            rows = starts if isinstance(rows, slice) else rows[starts]
        if position is not None and mapped.position is not None:
            _, source, name = mapped.position
            unit = rad_s_from_rpm(1.0) if name == "speed_rpm" else 1.0
            slope = backward_difference(position, values["time_s"], segment, source.wrap)
            values["speed_rad_s"] = unit * (source.scale * slope + source.offset)
        name, drive = self._driven_by(table, values, mapped)
        current_A, leading = held_current(values[name], segment)
        gaps = int(np.isnan(values[name][begin:]).sum())
        tally.rows, tally.kept = tally.rows + table.rows - begin, tally.kept + len(segment) - begin
        tally.leading, tally.held = tally.leading + leading, tally.held + gaps - leading
        delay_s = values.get("command_delay_s")
        delay_s = np.zeros(len(segment)) if delay_s is None else np.where(np.isnan(delay_s), 0.0, delay_s)
        _check_delay(table, delay_s, rows)
        log = WheelLog(
            name=table.path,
            time_s=values["time_s"],
            speed_rad_s=values["speed_rad_s"],
            current_A=current_A if drive == "constant" else np.array(current_A),
            drive=drive,
            command_delay_s=delay_s,
            segment=segment,
            channels={name: values[name] for name in CHANNELS if name in values and name not in mapped.constant},
            other={name: _taken(column, rows) for name, column in mapped.other.items() if self._carries(name)},
            rows_read=tally.rows,
            skipped_rows=tally.skipped,
            in_rpm=mapped.in_rpm or (mapped.position is not None and mapped.position[2] == "speed_rpm"),
            sources=mapped.sources,
            guessed=self._columns.guessed,
            faults=(*mapped.faults, *([] if tally.clock is None else [tally.clock])),
        )
        return log, begin, Rows.last_of(log, {**values, name: current_A}, keep_s)

    def _rows_to_keep(self, table: RawTable, mapped: MappedColumns, segment: Int64Array) -> BoolArray:
        """Rows (n,) that continue the one before, or say something new."""
        time_s, tally = mapped.values["time_s"], self.tally
        new = np.ones(table.rows, dtype=np.bool_)
        if self._columns.repeats == "drop":
            new = new_rows([time_s, *(values for name, values in mapped.values.items() if name != "time_s")], segment)
        keep = new.copy()
        keep[new] = rows_in_order(time_s[new], segment[new])
        skipped = int(new.sum() - keep.sum())
        if skipped:
            reading = mapped.values["speed_rad_s"] if mapped.position is None else mapped.position[0]
            tally.clock = tally.clock or clock_set_back(time_s, reading, segment, table.place)
            tally.first_skipped = tally.first_skipped or table.place(int(np.argmin(keep | ~new)))
            tally.skipped += skipped
        return keep

    def _driven_by(
        self, table: RawTable, values: Mapping[str, Float64Array], mapped: MappedColumns
    ) -> tuple[str, Drive]:
        """The column of the current that drives the model, and what it is; of later parts that of the first one."""
        if self._drive is not None:
            return self._drive
        candidates = [name for name in _CURRENTS if name in values]
        filled = [name for name in candidates if not np.isnan(values[name]).all()]
        if not filled:
            raise LogError(
                f"{table.path}: column '{candidates[0]}' is empty throughout: the model needs the current; "
                "if there was none, map it with {constant: 0.0}"
            )
        name = filled[0]
        switched = f"{table.path}: column '{candidates[0]}' is empty throughout; '{name}' drives the model"
        self._stated.append(switched if name != candidates[0] else "")
        what: Drive = "current_command_A" if name == "current_command_A" else "current_A"
        self._drive = name, "constant" if name in mapped.constant else what
        return self._drive

    def _carries(self, name: str) -> bool:
        return self._carried is None or name in self._carried


@dataclass(frozen=True, eq=False)
class Rows:
    """The last rows of a part, which the next one begins with: what came before is known there."""

    rows: int
    values: Mapping[str, Float64Array]  # (rows,) by name, as they are mapped; the current held over its gaps
    other: Mapping[str, Any]  # those carried along

    @classmethod
    def last_of(cls, log: WheelLog, values: Mapping[str, Float64Array], seconds: float) -> Rows:
        """The rows of so many seconds at the end of a log, of its last segment; not one for none."""
        begin = int(np.searchsorted(log.segment, log.segment[-1]))
        first = begin + int(np.searchsorted(log.time_s[begin:], log.time_s[-1] - seconds))
        first = max(first, len(log) - _MOST_BEFORE) if seconds > 0.0 else len(log)
        here = slice(first, len(log))
        kept = {name: np.array(array[here]) for name, array in values.items()}
        return cls(len(log) - first, kept, {name: column[here] for name, column in log.other.items()})


def _behind(before: Rows, table: RawTable, mapped: MappedColumns) -> tuple[RawTable, MappedColumns]:
    """The table and its columns behind rows of the one before it."""
    values = {name: np.concatenate((before.values[name], array)) for name, array in mapped.values.items()}
    other = {name: _one_below_the_other(before.other[name], mapped.other[name]) for name in before.other}
    shifted = replace(table, rows=before.rows + table.rows, place=lambda row: table.place(row - before.rows))
    return shifted, replace(mapped, values=values, other=other)


def _one_below_the_other(above: Any, below: Any) -> Any:
    import pyarrow as pa

    return pa.concat_arrays([above, _taken(below, slice(None))])


def _all_present(table: RawTable, values: Float64Array, name: str, why: str) -> None:
    gaps = np.isnan(values)
    if gaps.any():
        place = table.place(int(np.argmax(gaps)))
        raise LogError(f"{table.path}: {place}, column '{name}': is empty or nan, {why}: mend or remove the row")


def _segments(table: RawTable, mapped: MappedColumns) -> Int64Array:
    values = mapped.values.get("segment")
    if values is None:
        return np.zeros(table.rows, dtype=np.int64)
    _all_present(table, values, "segment", "every row needs its segment")
    return segment_ids(values)


def _check_delay(table: RawTable, delay_s: Float64Array, rows: Any) -> None:
    negative = delay_s < 0.0
    if negative.any():
        index = int(np.argmax(negative))
        row = index if isinstance(rows, slice) else int(rows[index])
        raise LogError(
            f"{table.path}: {table.place(row)}, column 'command_delay_s': {delay_s[index]} is negative: a command "
            "cannot act before the row it stands in"
        )


def _taken(column: Any, rows: Any) -> Any:
    """Rows of a carried column, as one pyarrow array."""
    import pyarrow as pa

    if isinstance(column, pa.ChunkedArray):
        column = column.combine_chunks()
    array = column if isinstance(column, pa.Array) else pa.array(column)
    return array if isinstance(rows, slice) else array.take(pa.array(rows))
