"""What happens in a run, told once: changes of state and compensation, alarms that begin and end."""

from __future__ import annotations

from typing import Any

from rw_ekf.clock import Clock
from rw_ekf.logs.metadata import utc_text
from rw_ekf.records import ActiveAlarm, CompensationNow, StateNow, Tick


class Happenings:
    """Turns of a run as events, each a JSON object; `first` is the state at the start."""

    def __init__(self, clock: Clock, began: StateNow) -> None:
        self._clock = clock
        self._state = began
        self._alarms: dict[str, ActiveAlarm] = {}
        self._time_s: float | None = None  # of the last sample
        self._compensation: dict[str, Any] = {}
        self.first: dict[str, Any] = {"utc": began.since_utc, "time_s": None, **_of_state(began, None)}

    def of(self, tick: Tick) -> list[dict[str, Any]]:
        """What changed with this turn."""
        time_s = self._time_s = tick.estimate.time_s
        found = []
        if tick.state is not None and tick.state != self._state:
            found.append({"utc": tick.state.since_utc, "time_s": time_s, **_of_state(tick.state, self._state)})
            self._state = tick.state
        if tick.compensation is not None:
            found += self._of_compensation(time_s, tick.compensation)
        if tick.alarms or tick.alarms_over or self._alarms:
            found += self._of_alarms(time_s, tick)
        return found

    def end(self) -> dict[str, Any]:
        """The event that a run ends with."""
        return {"utc": self._utc(), "time_s": self._time_s, "event": "ended", "state": self._state.state.value}

    def _of_compensation(self, time_s: float, now: CompensationNow) -> list[dict[str, Any]]:
        said = {"scheme": now.scheme, "on": now.on, "parameters": now.parameters, "reason": now.reason}
        if said == self._compensation:
            return []
        self._compensation = said
        return [{"utc": self._utc(), "time_s": time_s, "event": "compensation", **said}]

    def _of_alarms(self, time_s: float, tick: Tick) -> list[dict[str, Any]]:
        """Ends before beginnings: in a train of spikes one ends where the next sets in."""
        on = {alarm.name: alarm for alarm in tick.alarms}
        now = {"utc": self._utc(), "time_s": time_s}
        found: list[dict[str, Any]] = [{**now, "event": "alarm_over", **a.document()} for a in tick.alarms_over]
        told = {alarm.name for alarm in tick.alarms_over}
        for name in self._alarms.keys() - on.keys() - told:  # the watch itself has ended
            found.append({**now, "event": "alarm_over", "name": name})
        for name, alarm in on.items():
            if name not in self._alarms or self._alarms[name].since_s != alarm.since_s:
                found.append({**now, "event": "alarm", **alarm.document()})
        self._alarms = on
        return found

    def _utc(self) -> str:
        return utc_text(self._clock.utc())


def _of_state(now: StateNow, was: StateNow | None) -> dict[str, Any]:
    return {
        "event": "state",
        "state": now.state.value,
        "was": None if was is None else was.state.value,
        "reason": now.reason,
    }
