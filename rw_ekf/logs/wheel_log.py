"""A log as the rest of the project sees it: SI, one array per quantity, time strictly increasing within a segment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.logs.log_columns import LOG_COLUMNS
from rw_ekf.logs.raw_table import taken
from rw_ekf.logs.tables import table_of, write_table

if TYPE_CHECKING:
    import pyarrow as pa
    from matplotlib.figure import Figure

    from rw_ekf.logs.column_map import Source
    from rw_ekf.logs.long_log import LongLog

_SHOWN_ROWS = 5
_FURTHER = ("bus_voltage_V", "pressure_Pa")
Drive = Literal["current_command_A", "current_A", "constant"]


@dataclass(eq=False, frozen=True, repr=False)
class WheelLog:
    """A read log of n rows. All arrays are C-contiguous and of length n; NaN is a value that is missing."""

    name: str  # path it was read from
    time_s: Float64Array  # (n,) of the speed reading [s]; finite, strictly increasing within a segment
    speed_rad_s: Float64Array  # (n,) [rad/s]; NaN: missing
    current_A: Float64Array  # (n,) the current that drives the model from time_s to the next row [A]; finite
    drive: Drive  # where current_A came from
    command_delay_s: Float64Array  # (n,) from time_s until current_A takes force [s]; until then the previous holds
    segment: Int64Array  # (n,) from 0, one more wherever the log's segment column changes
    channels: dict[str, Float64Array] = field(default_factory=dict)  # those of CHANNELS the log has, as it has them
    other: dict[str, Any] = field(default_factory=dict)  # unknown columns, carried along: name -> pyarrow.Array (n,)
    rows_read: int = 0  # data rows of the file, before any was skipped or decimated
    left_out: int = 0  # rows between the stretches of an excerpt (`rw_ekf.logs.excerpt`)
    whole: LongLog | None = None  # of which this is an excerpt
    skipped_rows: int = 0  # repeated or backward in time
    warnings: tuple[str, ...] = ()  # what was mended in reading; each fit to be shown to a user
    in_rpm: bool = False  # the speed came in rpm: whatever the plant is, it turns, and a reader thinks in rpm
    sources: dict[str, Source] = field(default_factory=dict)  # where its columns came from, by name; empty: no file
    guessed: bool = False  # what its columns are was concluded, and stated by nobody
    faults: tuple[str, ...] = ()  # what shows that a column is not what it is taken for (`rw_ekf.identify.misread`)

    def __len__(self) -> int:
        return len(self.time_s)

    def __repr__(self) -> str:
        return f"Log({self.name!r}, {len(self)} samples, {self.duration_s:g} s)"

    def _repr_html_(self) -> str:
        table = self.table.slice(0, _SHOWN_ROWS)
        head = "".join(f"<th>{escape(name)}</th>" for name in table.column_names)
        rows = ("".join(f"<td>{escape(str(value))}</td>" for value in row.values()) for row in table.to_pylist())
        body = "".join(f"<tr>{cells}</tr>" for cells in rows)
        return f"<p>{escape(repr(self))}</p><table><tr>{head}</tr>{body}</table>"

    @classmethod
    def from_arrays(cls, time_s: ArrayLike, *, name: str = "arrays", **columns: ArrayLike) -> WheelLog:
        """A log of arrays by the names that a log's columns have: speed_rad_s or speed_rpm, current_A and so on.

        The rules are those of a file: NaN is a gap, rows that go backward are skipped. Raises LogError.
        """
        from rw_ekf.logs.reader import log_of_arrays

        return log_of_arrays({"time_s": time_s, **columns}, name)

    @property
    def _columns(self) -> dict[str, Any]:
        """Its columns in the fixed order, then the unknown ones; those that say nothing are left out.

        The raw currents are as the log has them, gaps included: reading holds them again.
        """
        columns: dict[str, Any] = {"time_s": self.time_s, "speed_rad_s": self.speed_rad_s, **self.channels}
        if self.drive not in self.channels:
            columns["current_command_A"] = self.current_A
        if (self.command_delay_s != 0.0).any():
            columns["command_delay_s"] = self.command_delay_s
        if len(self) and self.segment[-1] > 0:
            columns["segment"] = self.segment
        ordered = {name: columns[name] for name in LOG_COLUMNS if name in columns}
        return ordered | {name: values for name, values in self.other.items() if name not in ordered}

    @property
    def table(self) -> pa.Table:
        """The log as a pyarrow Table, which pandas and polars take."""
        return table_of(self._columns)

    def save(self, path: str | Path) -> None:
        """Write it: CSV, Parquet or MATLAB by suffix, all or nothing; what is read back is the same log.

        Raises BadInputError for another suffix or a place that cannot be written.
        """
        write_table(path, self._columns)

    def to_json(self) -> str:
        """The columns by name, as one JSON document; NaN is null."""
        from rw_ekf.json_output import json_text

        return json_text({"schema": "rw_ekf.log/1", "log": self.name, "columns": self.table.to_pydict()})

    def plot(self) -> Figure:
        """Speed and current over time, as a matplotlib figure."""
        from rw_ekf.logs.log_picture import log_figure

        return log_figure(self.name, self.time_s, self.speed_rad_s, self.current_A, in_rpm=self.in_rpm)

    def rows(self, chosen: slice | Int64Array) -> WheelLog:
        """Some of its rows, in their order."""
        return replace(
            self,
            time_s=self.time_s[chosen],
            speed_rad_s=self.speed_rad_s[chosen],
            current_A=self.current_A[chosen],
            command_delay_s=self.command_delay_s[chosen],
            segment=self.segment[chosen],
            channels={name: values[chosen] for name, values in self.channels.items()},
            other={name: taken(values, chosen) for name, values in self.other.items()},
        )

    @property
    def further_columns(self) -> tuple[str, ...]:
        """Names of logged numbers that are neither time, motion nor drive: what a law may be a function of."""
        own = [name for name in _FURTHER if name in self.channels]
        return (*own, *(name for name in self.other if self.numbers(name) is not None))

    def numbers(self, name: str) -> Float64Array | None:
        """A column by name as numbers (n,), NaN where one is missing; None where there is none, or it is text."""
        if name in self.channels:
            return self.channels[name]
        values = self.other.get(name)
        if values is None:
            return None
        try:
            numbers = np.array(values.to_numpy(zero_copy_only=False), dtype=np.float64)
        except (TypeError, ValueError):
            return None
        return numbers if numbers.size == len(self) else None

    @property
    def rate_hz(self) -> float:
        """Samples per second: one over the median step within segments [Hz]; NaN where no segment has two rows."""
        step_s = np.diff(self.time_s)[np.diff(self.segment) == 0]
        return float(1.0 / np.median(step_s)) if len(step_s) else float("nan")

    @property
    def duration_s(self) -> float:
        """Time covered: first to last row of each segment, summed over segments [s]."""
        return float(np.diff(self.time_s)[np.diff(self.segment) == 0].sum())


def put_together(logs: Sequence[WheelLog]) -> WheelLog:
    """Rows of one log under each other, with segments as each has them; the rest is that of the first."""
    import pyarrow as pa

    first = logs[0]
    return replace(
        first,
        time_s=np.concatenate([log.time_s for log in logs]),
        speed_rad_s=np.concatenate([log.speed_rad_s for log in logs]),
        current_A=np.concatenate([log.current_A for log in logs]),
        command_delay_s=np.concatenate([log.command_delay_s for log in logs]),
        segment=np.concatenate([log.segment for log in logs]),
        channels={name: np.concatenate([log.channels[name] for log in logs]) for name in first.channels},
        other={name: pa.concat_arrays([log.other[name] for log in logs]) for name in first.other},
    )
