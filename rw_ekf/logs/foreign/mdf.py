"""MDF 3 and 4, as measurement systems of the car industry write them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.child import groups_by_child
from rw_ekf.logs.foreign.groups import Group, table_of_groups
from rw_ekf.logs.foreign.guard import Library, foreign_format
from rw_ekf.logs.raw_table import RawTable

_IS_TIME = (0, 1)  # sync_type of a master channel: not said, time
_LONGEST_NAME = 60


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """Channel groups as groups, each on its master channel. A value that the recorder marked as invalid is a gap."""
    return table_of_groups(groups_by_child(f"{__name__}:groups_of", path), columns, name)  # it crashes of damage


def groups_of(path: Path) -> list[Group]:
    """All groups of a file. Raises whatever the library does."""
    import asammdf

    with path.open("rb") as stream, asammdf.MDF(stream) as file:
        return [_group(file, number) for number in range(len(file.groups))]


def _group(file: Any, number: int) -> Group:
    held = file.groups[number]
    master = file.masters_db.get(number)
    timed = master is not None and getattr(held.channels[master], "sync_type", 1) in _IS_TIME
    time_s = np.asarray(file.get_master(number), dtype=np.float64) if timed else None
    others = [(index, channel.name) for index, channel in enumerate(held.channels) if not (timed and index == master)]
    signals = {name: _signal(file, number, index) for index, name in others}
    channels = {name: _values(signal) for name, signal in signals.items()}
    units = {name: str(signal.unit) for name, signal in signals.items() if signal.unit}
    remarks = {name: str(signal.comment) for name, signal in signals.items() if signal.comment}
    return Group(_name(held.channel_group, number), time_s, channels, units, remarks)


def _name(group: Any, number: int) -> str:
    said = [str(getattr(group, key, "") or "").strip() for key in ("acq_name", "comment")]
    return next((text for text in said if text and len(text) <= _LONGEST_NAME and "\n" not in text), f"group {number}")


def _signal(file: Any, number: int, index: int) -> Any:
    return file.get(group=number, index=index, raw=True, ignore_invalidation_bits=True)


def _values(signal: Any) -> Any:
    """Samples in their unit; of a conversion to texts the numbers that it is made from."""
    samples = signal.physical(ignore_value2text_conversions=True).samples
    if signal.invalidation_bits is None or samples.dtype.kind not in "fiub":
        return samples
    return np.where(signal.invalidation_bits, np.nan, samples)


FORMAT = foreign_format(
    "an MDF file",
    lambda head, suffix: head.startswith((b"MDF     ", b"UnFinMF ")),
    "the first bytes 'MDF     '",
    _read,
    Library("mdf", ("asammdf",)),
    "export it as CSV, Parquet or MATLAB",
)
