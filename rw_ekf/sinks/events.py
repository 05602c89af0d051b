"""What happened in a run, a line each: changes of its state, alarms that begin and end (JSON Lines)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rw_ekf.clock import Clock
from rw_ekf.errors import BadInputError
from rw_ekf.logs.metadata import utc_text
from rw_ekf.records import ActiveAlarm, StateNow, Tick


class EventsSink:
    """Appends an event to the file as it comes; the file is made with the first, which is the state at the start."""

    def __init__(self, path: Path, clock: Clock, began: StateNow) -> None:
        """Raises BadInputError if the file cannot be made."""
        self._clock = clock
        self._state = began
        self._alarms: dict[str, ActiveAlarm] = {}
        try:
            self._file = path.open("a", encoding="utf-8")
        except OSError as error:
            raise BadInputError(f"{path}: cannot be made ({error.strerror}): give another output.directory") from None
        self._append({"utc": began.since_utc, "time_s": None, **_of_state(began, None)})

    def write(self, tick: Tick) -> None:
        """Append what changed with this tick."""
        time_s = tick.estimate.time_s
        if tick.state is not None and tick.state != self._state:
            self._append({"utc": tick.state.since_utc, "time_s": time_s, **_of_state(tick.state, self._state)})
            self._state = tick.state
        if tick.alarms or self._alarms:
            self._note_alarms(time_s, {alarm.name: alarm for alarm in tick.alarms})

    def close(self) -> None:
        """Finish the file."""
        if not self._file.closed:
            self._append({"utc": self._utc(), "time_s": None, "event": "ended", "state": self._state.state.value})
            self._file.close()

    def _note_alarms(self, time_s: float, on: dict[str, ActiveAlarm]) -> None:
        for name, alarm in on.items():
            if name not in self._alarms:
                self._append({"utc": self._utc(), "time_s": time_s, "event": "alarm", **alarm.document()})
        for name in self._alarms.keys() - on.keys():
            self._append({"utc": self._utc(), "time_s": time_s, "event": "alarm_over", "name": name})
        self._alarms = on

    def _utc(self) -> str:
        return utc_text(self._clock.utc())

    def _append(self, event: dict[str, Any]) -> None:
        self._file.write(json.dumps(event, allow_nan=False) + "\n")
        self._file.flush()


def _of_state(now: StateNow, was: StateNow | None) -> dict[str, Any]:
    return {
        "event": "state",
        "state": now.state.value,
        "was": None if was is None else was.state.value,
        "reason": now.reason,
    }
