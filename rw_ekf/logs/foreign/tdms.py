"""LabVIEW TDMS files."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.groups import Group, table_of_groups
from rw_ekf.logs.foreign.guard import Library, foreign_format
from rw_ekf.logs.raw_table import RawTable

_TIME = re.compile(r"(time|t|zeit|timestamp|time[ _]stamp)([ _]*[\[(]?s(ec(onds)?)?[\])]?)?", re.IGNORECASE)  # [s]


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """Groups as they are in the file, taken apart where their channels have several rates."""
    import nptdms

    with path.open("rb") as stream:
        file = nptdms.TdmsFile.read(stream)
        groups = [part for group in file.groups() for part in _parts(group)]
    return table_of_groups(groups, columns, name)


def _parts(group: Any) -> list[Group]:
    """Channels of one length and one waveform timing each; a part of several goes by its first channel too."""
    parts: dict[tuple[float, ...], list[Any]] = {}
    for channel in group.channels():
        parts.setdefault((len(channel), *_timing(channel)), []).append(channel)
    return [
        _group(group.name if len(parts) == 1 else f"{group.name}/{held[0].name}", held, step_s, offset_s)
        for (_, step_s, offset_s), held in parts.items()
    ]


def _timing(channel: Any) -> tuple[float, float]:
    """Step and offset of a waveform [s]; zero where the channel is none."""
    return tuple(float(channel.properties.get(key, 0.0)) for key in ("wf_increment", "wf_start_offset"))  # type: ignore[return-value]


def _group(name: str, held: list[Any], step_s: float, offset_s: float) -> Group:
    """Times from the waveform's step, or from a channel of time stamps, or from one that is called time."""
    channels = {channel.name: channel[:] for channel in held}
    if step_s > 0.0:
        return Group(name, np.asarray(offset_s + step_s * np.arange(len(held[0])), dtype=np.float64), channels)
    stamps = next((key for key, values in channels.items() if values.dtype.kind == "M"), None)
    if stamps is not None:
        return Group(name, _seconds(channels.pop(stamps)), channels)
    called = next((key for key, values in channels.items() if _TIME.fullmatch(key) and values.dtype.kind == "f"), None)
    return Group(name, None if called is None else np.asarray(channels[called], dtype=np.float64), channels)


def _seconds(stamps: Any) -> Float64Array:
    """Time stamps (n,) as seconds since 1970."""
    return np.asarray(stamps.astype("datetime64[us]").astype(np.int64) / 1.0e6)


FORMAT = foreign_format(
    "a TDMS file",
    lambda head, suffix: head.startswith(b"TDSm"),
    "the first bytes 'TDSm'",
    _read,
    Library("tdms", ("nptdms",)),
    "save it as LVM or CSV",
)
