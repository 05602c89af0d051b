"""Reads a file in a process of its own, for a library that a damaged file makes crash."""

from __future__ import annotations

import importlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import BinaryIO, NoReturn

import numpy as np

from rw_ekf.logs.foreign.groups import Group

_CHILD = (
    "import json, sys; path, point, file = json.loads(sys.argv[1]); sys.path[:] = path; "
    "from rw_ekf.logs.foreign.child import answer; answer(point, file)"
)


def groups_by_child(point: str, path: Path) -> list[Group]:
    """What `module:function` makes of a path. Raises ValueError where that fails, or the process dies of it."""
    command = [sys.executable or "python3", "-P", "-c", _CHILD, json.dumps([sys.path, point, str(path.absolute())])]
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


def answer(point: str, file: str) -> None:
    """The child: write the groups to standard output, or what went wrong to standard error, and exit."""
    from rw_ekf.parent import die_with_parent

    die_with_parent()
    module, _, function = point.partition(":")
    stream = sys.stdout.buffer
    sys.stdout = sys.stderr  # where a library prints is no place for it
    try:
        groups = getattr(importlib.import_module(module), function)(Path(file))
    except Exception as error:  # noqa: BLE001 - it is the parent's to say
        sys.stderr.write(f"\n{(str(error).strip().splitlines() or [type(error).__name__])[0]}\n")
        sys.stderr.flush()
        _leave(1)
    _pack(groups, stream)
    stream.flush()
    _leave(0)


def _leave(status: int) -> NoReturn:
    """End without deleting what a library has half built."""
    os._exit(status)


def _pack(groups: list[Group], stream: BinaryIO) -> None:
    """Names as JSON, then every array, as one archive of numpy."""
    arrays: list[object] = []
    names = []
    for group in groups:
        names.append([group.name, group.time_s is not None, list(group.channels), group.units, group.remarks])
        arrays += [*([] if group.time_s is None else [group.time_s]), *group.channels.values()]
    said = np.frombuffer(json.dumps(names).encode(), dtype=np.uint8)
    np.savez(stream, said, *arrays)  # type: ignore[arg-type]


def _unpacked(stream: BinaryIO) -> list[Group]:
    with np.load(stream, allow_pickle=False) as archive:
        held = iter([archive[f"arr_{number}"] for number in range(len(archive.files))])
    groups = []
    for name, timed, channels, units, remarks in json.loads(bytes(next(held))):
        time_s = next(held) if timed else None
        groups.append(Group(name, time_s, {channel: next(held) for channel in channels}, units, remarks))
    return groups
