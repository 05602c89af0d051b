"""A log out again, in any of the three forms, with the columns of docs/logs.md: what is read back is the same log."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rw_ekf.logs.tables import write_table
from rw_ekf.logs.wheel_log import LOG_COLUMNS, WheelLog


def export_log(log: WheelLog, out: str | Path) -> None:
    """Write `log` to `out`: CSV, Parquet or MATLAB by suffix, all or nothing.

    Raises BadInputError for another suffix or a place that cannot be written.
    """
    write_table(out, log_columns(log))


def log_columns(log: WheelLog) -> dict[str, Any]:
    """Columns of a log in the fixed order, then the unknown ones; those that say nothing are left out.

    The raw currents are written where the log has them, gaps included: reading holds them again.
    """
    columns: dict[str, Any] = {"time_s": log.time_s, "speed_rad_s": log.speed_rad_s, **log.channels}
    if log.drive not in log.channels:
        columns["current_command_A"] = log.current_A
    if (log.command_delay_s != 0.0).any():
        columns["command_delay_s"] = log.command_delay_s
    if len(log) and log.segment[-1] > 0:
        columns["segment"] = log.segment
    ordered = {name: columns[name] for name in LOG_COLUMNS if name in columns}
    return ordered | {name: values for name, values in log.other.items() if name not in ordered}
