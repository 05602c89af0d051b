"""What a run has published of itself, read by another process: is it alive, in what state, since when, and where.

A relative `output.directory` is relative to where the run was started, which nobody else can know: the run leaves word.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel, Field, StrictInt, ValidationError

from rw_ekf.live.port_claim import DIRECTORIES, put_shared, shared_directory
from rw_ekf.live.process import facts_of
from rw_ekf.logs.metadata import moment_of
from rw_ekf.plain_file import json_of, read_plain
from rw_ekf.records import RunState
from rw_ekf.sinks.run_files import lasting_stem, state_path

if TYPE_CHECKING:
    from collections.abc import Collection

    from rw_ekf.settings.schema import Configuration

_STALE_S, _STALE_TURNS = 5.0, 3.0  # the state file is replaced once a second, or once a turn
_MOST_BYTES = 1_000_000  # one has some 3 kB
_MOST_BYTES_OF_WORD = 65_536


class _Link(BaseModel, extra="allow"):
    state: str | None = None


class _Alarm(BaseModel, extra="allow"):
    text: str


class _Compensation(BaseModel, extra="allow"):
    scheme: str
    on: bool
    reason: str | None = None


class _StateFile(BaseModel, extra="allow"):
    """What is read of a state file; `StateFileSink` writes it, and any program could have."""

    schema_is: Literal["rw_ekf.state/1"] = Field(alias="schema")
    pid: StrictInt
    start_ticks: StrictInt | None = None
    resume_signal: StrictInt | None = None
    run_state: str
    utc: str | None = None
    period_s: float = Field(0.1, gt=0.0)
    began_utc: str | None = None
    ended_utc: str | None = None
    since_utc: str | None = None
    reason: str | None = None
    link: _Link | None = None
    alarms: list[_Alarm] = []
    state: dict[str, float | None] | None = None
    std: dict[str, float | None] | None = None
    current_command_A: float | None = None
    log: str | None = None
    compensation: _Compensation | None = None


@dataclass(frozen=True)
class Published:
    """A state file, and whether the process that wrote it still runs."""

    document: dict[str, Any]
    alive: bool

    @property
    def run_state(self) -> str:
        """State of the run when it was last published."""
        return str(self.document["run_state"])

    def silence(self, utc: datetime) -> str:
        """A remark on a process that runs and has published nothing for long; empty where it has. utc: now.

        For five seconds, or where its loop is slower than that for three turns.
        """
        if not self.alive:
            return ""
        published = moment_of(self.document.get("utc"))
        if published is None:
            return " (when it published this is not known)"
        age_s = (utc - published).total_seconds()
        if age_s <= max(_STALE_S, _STALE_TURNS * float(self.document.get("period_s", 0.0))):
            return ""
        return f" (published {age_s:.0f} s ago: the daemon hangs, or its disk does or is full)"

    @property
    def pid(self) -> int:
        """Number of the process that wrote it."""
        return int(self.document["pid"])


def read_published(path: Path) -> Published | None:
    """Read a state file; None where there is none, or none of this version of the program."""
    try:
        document = json_of(read_plain(path, _MOST_BYTES))
    except OSError:
        return None
    try:
        pid = _StateFile.model_validate(document).pid
    except ValidationError:
        return None
    facts = facts_of(pid)
    return Published(document, facts is not None and facts.start_ticks == document.get("start_ticks"))


def crashed_in_safe(path: Path) -> str | None:
    """Why the run that left a state file was in SAFE when it died without an end in order; None where it was not."""
    found = _over_in_safe(path)
    return None if found is None or found.get("ended_utc") is not None else str(found.get("reason"))


def was_in_safe(path: Path) -> str | None:
    """How and why the run that left a state file was over while it was in SAFE; None where it was not.

    A run that begins anew drives the wheel, for somebody started it; what brought that one there may be there still.
    """
    found = _over_in_safe(path)
    if found is None:
        return None
    ended = found.get("ended_utc")
    over = f"died, last heard of at {found.get('utc')}" if ended is None else f"ended at {ended}"
    return f"the run before {over} in SAFE: {found.get('reason')}"


def _over_in_safe(path: Path) -> dict[str, Any] | None:
    found = read_published(path)
    return None if found is None or found.alive or found.run_state != RunState.SAFE else found.document


def safe_before(paths: Sequence[Path]) -> list[str | None]:
    """Why each wheel of a line is to begin in SAFE, where the daemon that left these state files died; None: it is not.

    In SAFE then, or its run had ended while the daemon continued for the others: halted, say, because another wheel
    answered. Such a run does not begin again by itself.
    """
    found = [read_published(path) for path in paths]
    died = {one.pid for one in found if one is not None and not one.alive and one.document.get("ended_utc") is None}
    reasons = []
    for path, one in zip(paths, found, strict=True):
        reason = crashed_in_safe(path)
        if reason is None and one is not None and one.pid in died and one.document.get("ended_utc") is not None:
            reason = f"its run had ended before the daemon died: {one.document.get('reason') or 'no reason is known'}"
        reasons.append(reason)
    return reasons


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
                    found.append((about.st_mtime_ns, Path(os.fsdecode(read_plain(word, _MOST_BYTES_OF_WORD)))))
    places = [place for _, place in sorted(found) if place.is_absolute() and place.name == here.name]
    return places[-1] if places else here


def _digest(configuration: Configuration) -> str:
    return hashlib.sha256(os.fsencode(lasting_stem(configuration))).hexdigest()[:16]
