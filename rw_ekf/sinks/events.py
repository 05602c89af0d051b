"""What happens in a run, reported once: changes of state and compensation, alarms; and as a file, a line each."""

from __future__ import annotations

import json
import math
from collections import deque
from pathlib import Path
from typing import Any

from rw_ekf.clock import Clock
from rw_ekf.errors import BadInputError
from rw_ekf.logs.metadata import utc_text
from rw_ekf.plain_file import append_line
from rw_ekf.records import ActiveAlarm, CompensationNow, StateNow, Tick


class Happenings:
    """Turns of a run as events, each a JSON object; `first` is the state at the start."""

    def __init__(self, clock: Clock, began: StateNow) -> None:
        self._clock = clock
        self._began_s = self._host_s = clock.monotonic()  # the other: of the last turn
        self._state = began
        self._alarms: dict[str, ActiveAlarm] = {}
        self._time_s: float | None = None  # of the last sample
        self._compensation: dict[str, Any] = {}
        self.first: dict[str, Any] = {**self._at(began.since_utc), **_of_state(began, None)}

    def of(self, tick: Tick) -> list[dict[str, Any]]:
        """What changed with this turn."""
        self._time_s = tick.estimate.time_s
        if math.isfinite(tick.host_s):  # a queue, or a disk, may bring a turn here late
            self._host_s = tick.host_s
        found = []
        if tick.state is not None and tick.state != self._state:
            found.append({**self._at(tick.state.since_utc), **_of_state(tick.state, self._state)})
            self._state = tick.state
        if tick.compensation is not None:
            found += self._of_compensation(tick.compensation)
        if tick.alarms or tick.alarms_over or self._alarms:
            found += self._of_alarms(tick)
        return found

    def end(self) -> dict[str, Any]:
        """The event that a run ends with."""
        return {**self._at(), "event": "ended", "state": self._state.state.value}

    def _of_compensation(self, now: CompensationNow) -> list[dict[str, Any]]:
        stated = {"scheme": now.scheme, "on": now.on, "parameters": now.parameters, "reason": now.reason}
        if stated == self._compensation:
            return []
        self._compensation = stated
        return [{**self._at(), "event": "compensation", **stated}]

    def _of_alarms(self, tick: Tick) -> list[dict[str, Any]]:
        """Ends before beginnings: in a train of spikes one ends where the next sets in."""
        on = {alarm.name: alarm for alarm in tick.alarms}
        now = self._at()
        found: list[dict[str, Any]] = [{**now, "event": "alarm_over", **a.document()} for a in tick.alarms_over]
        reported = {alarm.name for alarm in tick.alarms_over}
        for name in self._alarms.keys() - on.keys() - reported:  # the watch itself has ended
            found.append({**now, "event": "alarm_over", "name": name})
        for name, alarm in on.items():
            if name not in self._alarms or self._alarms[name].since_s != alarm.since_s:
                found.append({**now, "event": "alarm", **alarm.document()})
        self._alarms = on
        return found

    def _at(self, utc: str | None = None) -> dict[str, Any]:
        """When an event is, by three clocks: the day's, which may be set; the wheel's, which may jump; the run's."""
        run_s = round(self._host_s - self._began_s, 3)
        return {"utc": utc or utc_text(self._clock.utc()), "time_s": self._time_s, "run_s": run_s}


def _of_state(now: StateNow, was: StateNow | None) -> dict[str, Any]:
    return {
        "event": "state",
        "state": now.state.value,
        "was": None if was is None else was.state.value,
        "reason": now.reason,
    }


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
