"""The path of a file, as a user gives it: what is none is reported before any system call trips over it."""

from __future__ import annotations

import os
import re
from pathlib import Path

from rw_ekf.errors import BadInputError

_LONGEST_NAME = 255  # bytes, of a file on the systems that this runs on
_ADDRESS = re.compile(r"[a-z][a-z0-9+.-]+://", re.IGNORECASE)
_SHOWN = 40


def path_of(given: object, what: str = "a file") -> Path:
    """The path that was given. Raises BadInputError for another type, an address, and a text that is no path."""
    if not isinstance(given, str | os.PathLike) or not isinstance(text := os.fspath(given), str):
        raise BadInputError(f"{what} is wanted, by its path; found {type(given).__name__}")
    if _ADDRESS.match(text):
        raise BadInputError(f"{text}: is an address, and only files are read: fetch it, and give the path of the file")
    longest = max(len(os.fsencode(part)) for part in text.split("/"))
    if longest > _LONGEST_NAME or ("\n" in text and not os.path.exists(text)):
        shown = repr(text[:_SHOWN]) + "..." * (len(text) > _SHOWN)
        raise BadInputError(f"{shown}: {len(text)} characters that are no path: {what} is wanted, by its path")
    return Path(text)
