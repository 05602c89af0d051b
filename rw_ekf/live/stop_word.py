"""The word that `stop` leaves for a run that is still starting: it has no claim yet, so that nobody may signal it.

`stop` leaves the word first and looks for claims then; a run claims first and looks for a word then: whichever way the
two fall, one finds the other. The word is for the processes that are starting at that moment, by number and time of
birth, so that a start after the stop is none of its business.
"""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from typing import Any

from rw_ekf.live.port_claim import DIRECTORIES, put_shared, shared_directory
from rw_ekf.live.port_name import names_of
from rw_ekf.live.process import facts_of, other_processes, own_process
from rw_ekf.plain_file import json_of, read_plain

REPORTED_TO_STOP = "rw-ekf stop was asked for while this run was starting: nothing was commanded"

_BOOT = Path("/proc/sys/kernel/random/boot_id")
_PATTERN = "rw-ekf-*.stop"
_MOST_BYTES = 65_536


def leave_word(port: str) -> None:
    """Tell every run that is starting now, on this port if it is its own, not to begin. Never raises.

    One file of each user: the newest stop takes along what earlier ones hold, while those processes live.
    """
    facts = [facts_of(pid) for pid in other_processes()]
    starting = [[f.pid, f.start_ticks] for f in facts if f is not None and f.starts_a_run]
    if not starting:
        return
    names = sorted(names_of(port))
    path = shared_directory() / f"rw-ekf-{os.geteuid()}.stop"
    words = [word for word in _words(path) if word["for"] in starting and word["names"] != names]
    words += [{"names": names, "for": one} for one in starting]
    with contextlib.suppress(OSError):
        put_shared(path, json.dumps({"boot": _boot(), "words": words}).encode())


def stop_requested(port: str) -> bool:
    """Whether a stop of this port, by its own user or root, came while this process was starting."""
    me = list(own_process().values())
    names = names_of(port)
    found = [word for folder in DIRECTORIES for path in Path(folder).glob(_PATTERN) for word in _words(path)]
    return any(word["for"] == me and not names.isdisjoint(word["names"]) for word in found)


def _words(path: Path) -> list[dict[str, list[Any]]]:
    """What a file says that this user may heed; nothing where it is another's, of another boot, or not as written."""
    try:
        if os.lstat(path).st_uid not in {0, os.geteuid()} or path.is_symlink():
            return []
        content = json_of(read_plain(path, _MOST_BYTES))
        if content["boot"] != _boot():
            return []
        return [{"names": list(map(str, word["names"])), "for": list(word["for"])} for word in content["words"]]
    except (OSError, KeyError, TypeError):
        return []


def _boot() -> str:
    """Of which start of the machine the numbers are."""
    try:
        return _BOOT.read_text().strip()
    except OSError:
        return ""
