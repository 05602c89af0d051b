"""CAN logs (Vector ASC and BLF, candump, PEAK's TRC), decoded with the database that the column map names."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.errors import LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.format_library import Library, foreign_format, only_log_errors
from rw_ekf.logs.foreign.groups import Group, channels_of, table_of_groups
from rw_ekf.logs.raw_table import RawTable

_BLF = b"LOGG"
_ASC = re.compile(rb"(//[^\n]*\n)?(date [^\n]*\r?\n)?base +(hex|dec)")
_CANDUMP = re.compile(rb"\(\d+\.\d+\) +\w+ +[0-9A-Fa-f]{3,8}#")
_TRC = b";$FILEVERSION="
_IDS_SHOWN = 8
_DATABASES = (".dbc", ".kcd", ".sym", ".arxml")


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """Messages as groups, their signals in their units. Raises LogError without a fitting database.

    Where the map names none, it is the one in the log's folder that knows most of its ids, which is reported.
    """
    database = columns.dbc or _fitting(path, name)
    messages = _messages(database)
    times: dict[str, list[float]] = {}
    rows: dict[str, list[dict[str, float]]] = {}
    unknown: dict[int, int] = {}
    for frame in _frames(path):
        decoded = _decoded(messages.get((frame.arbitration_id, frame.is_extended_id)), frame)
        if decoded is None:
            unknown[frame.arbitration_id] = unknown.get(frame.arbitration_id, 0) + 1
            continue
        message, values = decoded
        times.setdefault(message, []).append(frame.timestamp)
        rows.setdefault(message, []).append(values)
    if not rows:
        raise LogError(f"{name}: none of its frames ({_shown(unknown)}) is in {database}: name the right database")
    units = {
        str(message.name): {signal.name: signal.unit for signal in message.signals if signal.unit}
        for message in messages.values()
    }
    remarks = {
        str(message.name): {signal.name: str(signal.comment) for signal in message.signals if signal.comment}
        for message in messages.values()
    }
    groups = [Group(key, np.array(times[key]), channels_of(rows[key]), units[key], remarks[key]) for key in rows]
    table = table_of_groups(groups, columns, name)
    if columns.dbc is None:
        table.warnings.append(f"{name}: its frames were decoded by {database}, which is beside it")
    if unknown:
        count = sum(unknown.values())
        table.warnings.append(f"{name}: {count} frames ({_shown(unknown)}) are not in {database} and were left out")
    return table


def _fitting(path: Path, name: str) -> str:
    """Of the databases in the folder of a log the one that knows more of its ids than others. Raises LogError."""
    found = sorted(file for file in path.parent.iterdir() if file.suffix.lower() in _DATABASES)
    ids = {(frame.arbitration_id, frame.is_extended_id) for frame in _frames(path)} if found else set()
    known = sorted(((len(ids & _ids_in(file)), str(file)) for file in found), reverse=True)
    if known and known[0][0] > 0 and (len(known) == 1 or known[0][0] > known[1][0]):
        return known[0][1]
    several = f"; beside it are {', '.join(file.name for file in found)}" if found else ""
    raise LogError(
        f"{name}: is a CAN log, whose frames mean nothing without their database: name it in the column map "
        f"(`dbc: wheel.dbc`){several}"
    )


def _ids_in(database: Path) -> set[tuple[int, bool]]:
    """What a database knows; nothing for one that cannot be read."""
    try:
        return set(_messages(str(database)))
    except LogError:
        return set()


def _messages(database: str) -> dict[tuple[int, bool], Any]:
    """Messages of a database by id, and whether that is an extended one. Raises LogError if it cannot be read."""
    import cantools

    if not Path(database).is_file():
        raise LogError(f"{database}: no such file (`dbc` in the column map; relative to it)")
    with only_log_errors(database, "a CAN database"):
        found = cantools.database.load_file(database, strict=False)
        return {(message.frame_id, message.is_extended_frame): message for message in found.messages}


def _frames(path: Path) -> Any:
    """Data frames in the order of the file."""
    from can.io import asc, blf, canutils, trc

    with path.open("rb") as stream:
        head = stream.read(len(_BLF) + 256)
    if head.startswith(_BLF):
        with path.open("rb") as stream, blf.BLFReader(stream) as frames:
            yield from filter(_has_data, frames)
    else:
        of_text: tuple[Any, Any] = canutils.CanutilsLogReader, asc.ASCReader
        kind = trc.TRCReader if head.startswith(_TRC) else of_text[not _CANDUMP.match(head)]
        with path.open(encoding="utf-8", errors="replace") as text, kind(text) as frames:
            yield from filter(_has_data, frames)


def _has_data(frame: Any) -> bool:
    return not (frame.is_error_frame or frame.is_remote_frame)


def _decoded(message: Any, frame: Any) -> tuple[str, dict[str, float]] | None:
    """Name and signals of a frame; None if it is not in the database, or not as that says."""
    if message is None:
        return None
    try:
        values = message.decode(bytes(frame.data), decode_choices=False, allow_truncated=True)
    except Exception:  # noqa: BLE001 - of what a frame holds too much or too little is made what it is: unknown
        return None
    return (
        (str(message.name), {key: float(value) for key, value in values.items()}) if isinstance(values, dict) else None
    )


def _shown(ids: dict[int, int]) -> str:
    shown = ", ".join(f"0x{number:X}" for number in list(ids)[:_IDS_SHOWN])
    return f"ids {shown}{', ...' if len(ids) > _IDS_SHOWN else ''}" if ids else "there is none"


FORMAT = foreign_format(
    "a CAN log",
    lambda head, suffix: head.startswith((_BLF, _TRC)) or bool(_ASC.match(head) or _CANDUMP.match(head)),
    "the first bytes 'LOGG' (BLF); the first lines of ASC, candump or TRC",
    _read,
    Library("can", ("can", "cantools")),
    "decode it to CSV",
)
