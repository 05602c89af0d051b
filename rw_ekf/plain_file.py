"""Files that the outside world has put there: only plain ones, no pipe or device is waited for; JSON of any depth."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import stat
from pathlib import Path
from typing import Any

_ANY = os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY  # opening a pipe that nobody writes to, or reads, does not wait
_APPEND = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW


def read_plain(path: str | Path, most_bytes: int) -> bytes:
    """Read the first most_bytes of a plain file. Raises OSError, also where a pipe, a device or a folder stands there.

    A read of a pipe waits for a writer, one of /dev/zero never ends: neither is what anybody meant by a file of ours.
    """
    with os.fdopen(_plain(path, os.O_RDONLY), "rb") as file:
        return file.read(most_bytes)


def append_line(path: str | Path, line: bytes) -> None:
    """Append a line to a plain file, which is made if it is not there. Raises OSError as `read_plain`, for a link too.

    Where it does not fit, no part of it stays behind.
    """
    descriptor = _plain(path, _APPEND)
    try:
        write_whole(descriptor, line, os.fstat(descriptor).st_size)
    finally:
        os.close(descriptor)


def write_whole(descriptor: int, data: bytes, length: int) -> None:
    """Write at the end of a file of that length. Raises OSError; no part of the data then stays behind."""
    done = 0
    try:
        while done < len(data):
            done += os.write(descriptor, data[done:])
    except OSError:
        with contextlib.suppress(OSError):
            os.ftruncate(descriptor, length)
        raise


def _plain(path: str | Path, flags: int) -> int:
    descriptor = os.open(path, flags | _ANY, 0o666)
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISREG(mode):
        return descriptor
    os.close(descriptor)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    raise OSError(errno.EINVAL, f"it is a {'pipe' if stat.S_ISFIFO(mode) else 'device'}, no plain file", str(path))


def file_part(name: str) -> str:
    """As much of a name as may stand in that of a file."""
    return "".join(c if c.isalnum() or c in "-_" else "-" for c in name)[:60]


def json_of(text: bytes | str) -> Any:
    """What a JSON text of outside holds; None where it is none, or nested deeper than anything that is meant."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None
