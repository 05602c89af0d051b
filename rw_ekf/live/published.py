"""What a run has published of itself, read by another process: is it alive, in what state, since when."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rw_ekf.live.process import facts_of
from rw_ekf.records import RunState
from rw_ekf.sinks.state_file import SCHEMA


@dataclass(frozen=True)
class Published:
    """A state file, and whether the process that wrote it still runs."""

    document: dict[str, Any]
    alive: bool

    @property
    def run_state(self) -> str:
        """State of the run when it was last published."""
        return str(self.document["run_state"])

    @property
    def pid(self) -> int:
        """Number of the process that wrote it."""
        return int(self.document["pid"])


def read_published(path: Path) -> Published | None:
    """Read a state file; None where there is none, or none of this version of the program."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        return None
    pid = document.get("pid")
    if not isinstance(pid, int) or not isinstance(document.get("run_state"), str):
        return None
    facts = facts_of(pid)
    return Published(document, facts is not None and facts.start_ticks == document.get("start_ticks"))


def crashed_in_safe(path: Path) -> str | None:
    """Why the run that left a state file was in SAFE when it died without an end in order; None where it was not."""
    found = read_published(path)
    if found is None or found.alive or found.run_state != RunState.SAFE or found.document.get("ended_utc") is not None:
        return None
    return str(found.document.get("reason"))
