"""MDF 3 and 4, as measurement systems of the car industry write them.

A damaged file makes the library that reads them crash: it does so in a process of its own.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.format_library import Library, foreign_format
from rw_ekf.logs.foreign.groups import Group, table_of_groups
from rw_ekf.logs.raw_table import RawTable

_IS_TIME = (0, 1)  # sync_type of a master channel: not stated, time
_LONGEST_NAME = 60
_CHILD = (
    "import json, sys; path, file = json.loads(sys.argv[1]); sys.path[:] = path; "
    "from rw_ekf.logs.foreign.mdf import answer; answer(file)"
)


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """Channel groups as groups, each on its master channel. A value that the recorder marked as invalid is a gap."""
    return table_of_groups(_groups_by_child(path), columns, name)


def _groups_by_child(path: Path) -> list[Group]:
    """All groups of a file, by a process of its own. Raises ValueError where that fails, or dies of it."""
    command = [sys.executable or "python3", "-P", "-c", _CHILD, json.dumps([sys.path, str(path.absolute())])]
    with tempfile.TemporaryFile() as answered:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, stdout=answered, stderr=subprocess.PIPE, check=False, errors="replace"
        )
        if done.returncode < 0:
            name = signal.Signals(-done.returncode).name
            raise ValueError(f"what reads it was ended by {name}")
        if done.returncode > 0:
            raise ValueError(done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "what reads it failed")
        answered.seek(0)
        return _unpacked(answered)


def answer(file: str) -> None:
    """The child: write the groups to standard output, or what went wrong to standard error, and exit."""
    from rw_ekf.parent_process import die_with_parent

    die_with_parent()
    stream = sys.stdout.buffer
    sys.stdout = sys.stderr  # where a library prints is no place for it
    try:
        groups = _groups_of(Path(file))
    except Exception as error:  # noqa: BLE001 - it is the parent's to say
        sys.stderr.write(f"\n{(str(error).strip().splitlines() or [type(error).__name__])[0]}\n")
        sys.stderr.flush()
        os._exit(1)
    _pack(groups, stream)
    stream.flush()
    os._exit(0)  # without deleting what the library has half built


def _pack(groups: list[Group], stream: BinaryIO) -> None:
    """Names as JSON, then every array, as one archive of numpy."""
    arrays: list[object] = []
    names = []
    for group in groups:
        names.append([group.name, group.time_s is not None, list(group.channels), group.units, group.remarks])
        arrays += [*([] if group.time_s is None else [group.time_s]), *group.channels.values()]
    stated = np.frombuffer(json.dumps(names).encode(), dtype=np.uint8)
    np.savez(stream, stated, *arrays)  # type: ignore[arg-type]


def _unpacked(stream: BinaryIO) -> list[Group]:
    with np.load(stream, allow_pickle=False) as archive:
        held = iter([archive[f"arr_{number}"] for number in range(len(archive.files))])
    groups = []
    for name, timed, channels, units, remarks in json.loads(bytes(next(held))):
        time_s = next(held) if timed else None
        groups.append(Group(name, time_s, {channel: next(held) for channel in channels}, units, remarks))
    return groups


def _groups_of(path: Path) -> list[Group]:
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
    stated = [str(getattr(group, key, "") or "").strip() for key in ("acq_name", "comment")]
    return next(
        (text for text in stated if text and len(text) <= _LONGEST_NAME and "\n" not in text), f"group {number}"
    )


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
