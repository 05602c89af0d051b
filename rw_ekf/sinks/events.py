"""What happened in a run, a line each: changes of state and compensation, alarms that begin and end (JSON Lines)."""

from __future__ import annotations

import errno
import json
import os
from collections import deque
from pathlib import Path
from typing import Any

from rw_ekf.clock import Clock
from rw_ekf.errors import BadInputError
from rw_ekf.logs.metadata import utc_text
from rw_ekf.plain_file import open_to_append
from rw_ekf.records import ActiveAlarm, CompensationNow, StateNow, Tick

_MOST_WAITING = 1000


class EventsSink:
    """Appends an event to the file as it comes; the file is made with the first, which is the state at the start.

    It is opened for each: events are rare, and a file that was removed is made again once its directory is there. What
    could not be written waits for the next event.
    """

    def __init__(self, path: Path, clock: Clock, began: StateNow) -> None:
        """Raises BadInputError if the file cannot be made."""
        self._clock = clock
        self._state = began
        self._alarms: dict[str, ActiveAlarm] = {}
        self._time_s: float | None = None  # of the last sample
        self._compensation: dict[str, Any] = {}
        self._path = path
        self._waiting: deque[bytes] = deque(maxlen=_MOST_WAITING)
        self._closed = False
        try:
            self._append({"utc": began.since_utc, "time_s": None, **_of_state(began, None)})
        except OSError as error:
            raise BadInputError(f"{path}: cannot be made ({error.strerror}): give another output.directory") from None

    def write(self, tick: Tick) -> None:
        """Append what changed with this tick."""
        time_s = self._time_s = tick.estimate.time_s
        if tick.state is not None and tick.state != self._state:
            self._append({"utc": tick.state.since_utc, "time_s": time_s, **_of_state(tick.state, self._state)})
            self._state = tick.state
        if tick.compensation is not None:
            self._note_compensation(time_s, tick.compensation)
        if tick.alarms or tick.alarms_over or self._alarms:
            self._note_alarms(time_s, tick)

    def close(self) -> None:
        """Finish the file."""
        if not self._closed:
            self._closed = True
            self._append(
                {"utc": self._utc(), "time_s": self._time_s, "event": "ended", "state": self._state.state.value}
            )

    def _note_compensation(self, time_s: float, now: CompensationNow) -> None:
        said = {"scheme": now.scheme, "on": now.on, "parameters": now.parameters, "reason": now.reason}
        if said != self._compensation:
            self._compensation = said
            self._append({"utc": self._utc(), "time_s": time_s, "event": "compensation", **said})

    def _note_alarms(self, time_s: float, tick: Tick) -> None:
        """Append ends before beginnings: in a train of spikes one ends where the next sets in."""
        on = {alarm.name: alarm for alarm in tick.alarms}
        now = {"utc": self._utc(), "time_s": time_s}
        for alarm in tick.alarms_over:
            self._append({**now, "event": "alarm_over", **alarm.document()})
        told = {alarm.name for alarm in tick.alarms_over}
        for name in self._alarms.keys() - on.keys() - told:  # the watch itself has ended
            self._append({**now, "event": "alarm_over", "name": name})
        for name, alarm in on.items():
            if name not in self._alarms or self._alarms[name].since_s != alarm.since_s:
                self._append({**now, "event": "alarm", **alarm.document()})
        self._alarms = on

    def _utc(self) -> str:
        return utc_text(self._clock.utc())

    def _append(self, event: dict[str, Any]) -> None:
        """Write what waits and this. Raises OSError; no part of a line stays behind."""
        self._waiting.append((json.dumps(event, allow_nan=False) + "\n").encode())
        descriptor = open_to_append(self._path)
        try:
            while self._waiting:
                length = os.fstat(descriptor).st_size
                if os.write(descriptor, self._waiting[0]) < len(self._waiting[0]):
                    os.ftruncate(descriptor, length)
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self._path))
                self._waiting.popleft()
        finally:
            os.close(descriptor)


def _of_state(now: StateNow, was: StateNow | None) -> dict[str, Any]:
    return {
        "event": "state",
        "state": now.state.value,
        "was": None if was is None else was.state.value,
        "reason": now.reason,
    }
