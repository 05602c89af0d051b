"""What happened in a run, a line each (JSON Lines)."""

from __future__ import annotations

import json
from collections import deque
from pathlib import Path
from typing import Any

from rw_ekf.clock import Clock
from rw_ekf.errors import BadInputError
from rw_ekf.plain_file import append_line
from rw_ekf.records import StateNow, Tick
from rw_ekf.sinks.happenings import Happenings

_MOST_WAITING = 1000


class EventsSink:
    """Appends an event to the file as it comes; the file is made with the first, which is the state at the start.

    It is opened for each: events are rare, and a file that was removed is made again once its directory is there. What
    could not be written waits for the next event.
    """

    def __init__(self, path: Path, clock: Clock, began: StateNow) -> None:
        """Raises BadInputError if the file cannot be made."""
        self._happenings = Happenings(clock, began)
        self._path = path
        self._waiting: deque[bytes] = deque(maxlen=_MOST_WAITING)
        self._closed = False
        try:
            self._append([self._happenings.first])
        except OSError as error:
            raise BadInputError(f"{path}: cannot be made ({error.strerror}): give another output.directory") from None

    def write(self, tick: Tick) -> None:
        """Append what changed with this tick."""
        found = self._happenings.of(tick)
        if found:
            self._append(found)

    def close(self) -> None:
        """Finish the file."""
        if not self._closed:
            self._closed = True
            self._append([self._happenings.end()])

    def _append(self, events: list[dict[str, Any]]) -> None:
        """Write what waits and these. Raises OSError; no part of a line stays behind."""
        self._waiting += [(json.dumps(event, allow_nan=False) + "\n").encode() for event in events]
        while self._waiting:
            append_line(self._path, self._waiting[0])
            self._waiting.popleft()
