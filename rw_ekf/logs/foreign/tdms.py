"""LabVIEW TDMS files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.format_library import Library, foreign_format
from rw_ekf.logs.foreign.groups import Group, table_of_groups
from rw_ekf.logs.labels import unit_and_remark
from rw_ekf.logs.raw_table import RawTable

_TIME = re.compile(r"(time|t|zeit|timestamp|time[ _]stamp)([ _]*[\[(]?s(ec(onds)?)?[\])]?)?", re.IGNORECASE)  # [s]


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """Groups as they are in the file, taken apart where their channels have several rates.

    Times count from the first that is known of the file as a date; those that are no dates stay as they are.
    """
    import nptdms

    with path.open("rb") as stream:
        file = nptdms.TdmsFile.read(stream)
        parts = [part for group in file.groups() for part in _parts(group)]
    first = min((start for _, start in parts if start is not None), default=np.datetime64(0, "us"))
    for group, start in parts:
        if start is not None and group.time_s is not None:
            group.time_s = _seconds(start - first) + group.time_s
    return table_of_groups([group for group, _ in parts], columns, name)


def _parts(group: Any) -> list[tuple[Group, Any]]:
    """Channels of one length and one waveform timing each, with their start; several go by their first channel too."""
    parts: dict[tuple[Any, ...], list[Any]] = {}
    for channel in group.channels():
        timing = (channel.properties.get(key) for key in ("wf_increment", "wf_start_offset", "wf_start_time"))
        parts.setdefault((len(channel), *timing), []).append(channel)
    return [
        _group(group.name if len(parts) == 1 else f"{group.name}/{held[0].name}", held, step_s, offset_s, start)
        for (_, step_s, offset_s, start), held in parts.items()
    ]


def _group(
    name: str, held: list[Any], step_s: float | None, offset_s: float | None, start: Any
) -> tuple[Group, np.datetime64 | None]:
    """Times from the waveform's step [s], or from a channel of time stamps, or from one that is called time."""
    channels = {channel.name: channel[:] for channel in held}
    stated = {channel.name: unit_and_remark(_further(channel.properties)) for channel in held}
    units = {key: unit for key, (unit, _) in stated.items() if unit}
    remarks = {key: remark for key, (_, remark) in stated.items() if remark}
    if step_s is not None and step_s > 0.0:
        time_s = (offset_s or 0.0) + step_s * np.arange(len(held[0]))
        begun = None if start is None else np.datetime64(start, "us")
        return Group(name, np.asarray(time_s, dtype=np.float64), channels, units, remarks), begun
    stamps = next((key for key, values in channels.items() if values.dtype.kind == "M" and len(values)), None)
    if stamps is not None:
        moments = channels.pop(stamps).astype("datetime64[us]")
        return Group(name, _seconds(moments - moments[0]), channels, units, remarks), moments[0]
    called = next((key for key, values in channels.items() if _TIME.fullmatch(key) and values.dtype.kind == "f"), None)
    time = None if called is None else np.asarray(channels[called], dtype=np.float64)
    return Group(name, time, channels, units, remarks), None


def _further(properties: Mapping[str, Any]) -> dict[str, Any]:
    """What is stated of a channel but for its timing, and what LabVIEW has for itself, as scales that are applied."""
    return {key: value for key, value in properties.items() if not key.startswith(("wf_", "NI_"))}


def _seconds(spans: Any) -> Float64Array:
    """Spans of time, one or (n,), as seconds."""
    return np.asarray(spans.astype("timedelta64[us]").astype(np.int64) / 1.0e6, dtype=np.float64)


FORMAT = foreign_format(
    "a TDMS file",
    lambda head, suffix: head.startswith(b"TDSm"),
    "the first bytes 'TDSm'",
    _read,
    Library("tdms", ("nptdms",)),
    "save it as LVM or CSV",
)
