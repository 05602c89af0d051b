"""Files that the outside world has put there, read only where they are plain: no pipe, no device is waited for."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path


def read_plain(path: str | Path, most_bytes: int) -> bytes:
    """Read the first most_bytes of a plain file. Raises OSError, also where a pipe, a device or a folder stands there.

    A read of a pipe waits for a writer, one of /dev/zero never ends: neither is what anybody meant by a file of ours.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY)
    with os.fdopen(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, "it is not a plain file", str(path))
        return file.read(most_bytes)
