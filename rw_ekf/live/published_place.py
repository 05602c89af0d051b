"""Where a run publishes what it does, for whoever asks from another folder.

A relative `output.directory` is relative to where the run was started, which nobody else can know: the run leaves word.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from pathlib import Path
from typing import TYPE_CHECKING

from rw_ekf.live.port_claim import DIRECTORIES, put_shared, shared_directory
from rw_ekf.plain_file import read_plain
from rw_ekf.sinks.run_files import lasting_stem, state_path

if TYPE_CHECKING:
    from collections.abc import Collection

    from rw_ekf.settings.schema import Configuration

_MOST_BYTES = 65_536


def leave_place(configuration: Configuration) -> None:
    """Leave word of where this run publishes; nothing where the configuration says it all. Never raises."""
    here = state_path(configuration)
    if not here.is_absolute():
        word = shared_directory() / f"rw-ekf-{os.geteuid()}-{_digest(configuration)}.place"
        with contextlib.suppress(OSError):
            put_shared(word, os.fsencode(here.absolute()))


def published_place(configuration: Configuration, holders: Collection[int] = ()) -> Path:
    """Path of the state file of the latest run: where it left word that it publishes, else as seen from here.

    Believed is a word of our own or of root, and of `holders`, the users whose daemon has the port now.
    """
    here = state_path(configuration)
    if here.is_absolute():
        return here
    trusted, found = {0, os.geteuid(), *holders}, []
    for directory in map(Path, DIRECTORIES):
        for word in directory.glob(f"rw-ekf-*-{_digest(configuration)}.place"):
            with contextlib.suppress(OSError):
                about = os.lstat(word)
                if about.st_uid in trusted and not word.is_symlink():
                    found.append((about.st_mtime_ns, Path(os.fsdecode(read_plain(word, _MOST_BYTES)))))
    places = [place for _, place in sorted(found) if place.is_absolute() and place.name == here.name]
    return places[-1] if places else here


def _digest(configuration: Configuration) -> str:
    return hashlib.sha256(os.fsencode(lasting_stem(configuration))).hexdigest()[:16]
