"""Files that are either whole or not there: written beside their place, synced, and renamed into it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rw_ekf.errors import BadInputError


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Give a temporary path in the same directory; it replaces `path` when the block ends without an exception.

    A symbolic link keeps pointing where it did, and a device or pipe (/dev/null) is written to directly.
    Raises BadInputError if the place cannot be written.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file() and not target.is_dir():
        yield target
        return
    if target.is_dir():
        raise BadInputError(f"{path}: is a directory: give the name of a file")
    temporary = target.with_name(f".{target.stem[:100]}.{os.getpid()}.tmp{target.suffix}")
    try:
        temporary.touch()
    except (OSError, ValueError) as error:
        raise _cannot_write(path, error) from None
    try:
        yield temporary
        _sync(temporary)
        os.replace(temporary, target)
        _sync(target.parent)
    except OSError as error:
        raise _cannot_write(path, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a UTF-8 text file, all or nothing. Raises BadInputError if the place cannot be written."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _sync(path: Path) -> None:
    """Push a file or directory entry to the disk, so that a loss of power cannot undo the rename."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _cannot_write(path: str | Path, error: OSError | ValueError) -> BadInputError:
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return BadInputError(f"{path}: cannot be written ({reason}): give another place, or make room")
