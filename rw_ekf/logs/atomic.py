"""Files that are either whole or not there: written beside their place, synced, and renamed into it; and new ones.

A directory may be one that others write to. The temporary name cannot be guessed and is made anew, never opened; a
symbolic link at the place itself is followed only where whoever runs this, or root, put it there; what a daemon writes
by itself replaces a link instead of following it.
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rw_ekf.checking.paths import path_of
from rw_ekf.errors import BadInputError, reason_of

_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
_MOST_LINKS = 40  # of one name, as the kernel counts


@contextmanager
def atomic_path(path: str | Path, *, follow: bool = True) -> Iterator[Path]:
    """Give a temporary path in the same directory; it replaces `path` when the block ends without an exception.

    follow: a symbolic link of one's own keeps pointing where it did, and a device or pipe (/dev/null) is written to
    directly; False replaces whatever stands there. Raises BadInputError if the place cannot be written.
    """
    path = path_of(path)
    target = _followed(path) if follow else Path(os.path.abspath(path))
    if follow and is_special(Path(path)):
        yield Path(path)
        return
    if target.is_dir() and not target.is_symlink():
        raise BadInputError(f"{path}: is a directory: give the name of a file")
    # Ends as no file of its kind does: who reads all of a folder by their endings, as duckdb does, passes it over.
    temporary = target.with_name(f".{target.stem[:100]}.{secrets.token_hex(8)}{target.suffix}.tmp")
    try:
        descriptor = os.open(temporary, _NEW, 0o666)
    except (OSError, ValueError) as error:
        raise _cannot_write(path, error) from None
    try:
        yield temporary
        if not os.path.samestat(os.lstat(temporary), os.fstat(descriptor)):
            raise BadInputError(f"{path}: another program put something else in the place of {temporary}: try again")
        _sync(temporary)
        os.replace(temporary, target)
        _sync(target.parent)
    except OSError as error:
        raise _cannot_write(path, error) from error
    finally:
        os.close(descriptor)  # open until here, so that no other file can have got its number
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str, *, follow: bool = True) -> None:
    r"""Write a UTF-8 text file, all or nothing. Raises BadInputError if the place cannot be written.

    A byte of a file's name that is not UTF-8 stands in it as on standard error, as \udcf6.
    """
    with atomic_path(path, follow=follow) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace")


def make_folder(path: Path, advice: str = "give another place") -> None:
    """Make a folder and those above it, where they are not there. Raises BadInputError where that cannot be."""
    path = path_of(path, "a folder")
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInputError(f"{path}: cannot be made a folder ({error.strerror or error}): {advice}") from None


def is_special(path: Path) -> bool:
    """Whether a device or a pipe stands there, which has no suffix that says anything."""
    return os.path.exists(path) and not path.is_file() and not path.is_dir()


def _followed(path: str | Path) -> Path:
    """Where the symbolic links at `path` lead. Raises BadInputError for a link that another user put there."""
    place = Path(os.path.abspath(path))
    for _ in range(_MOST_LINKS):
        try:
            link = os.lstat(place)
            if not place.is_symlink():
                break
            owner = link.st_uid
            if owner not in (os.geteuid(), 0):
                raise BadInputError(f"{path}: is a symbolic link of another user, not followed: give another place")
            place = Path(os.path.abspath(place.parent.resolve() / os.readlink(place)))
        except (OSError, ValueError):  # nothing there yet, or no name at all: writing will say what is wrong
            break
    return place


def _sync(path: Path) -> None:
    """Push a file or directory entry to the disk, so that a loss of power cannot undo the rename."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _cannot_write(path: str | Path, error: OSError | ValueError) -> BadInputError:
    return BadInputError(f"{path}: cannot be written ({reason_of(error)}): give another place, or make room")


@contextmanager
def begun_file(path: str | Path) -> Iterator[int]:
    """Make a file that grows, and give its descriptor, of which the block writes the beginning.

    Never overwrites: a file that exists is someone's data. Where there is no room for the beginning none is left
    behind. Raises BadInputError if it exists, or cannot be made.
    """
    descriptor = None
    try:
        descriptor = os.open(path, _NEW | os.O_APPEND, 0o666)
        yield descriptor
    except FileExistsError:
        raise BadInputError(f"{path}: exists already and is not overwritten: choose another name") from None
    except (OSError, ValueError) as error:
        if descriptor is not None:
            os.close(descriptor)
            with suppress(OSError):
                os.unlink(path)
        raise BadInputError(f"{path}: cannot be written ({reason_of(error)})") from None
