"""The latest estimate as one small JSON file, replaced whole each time."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rw_ekf.errors import RwEkfError
from rw_ekf.logs.atomic import write_text
from rw_ekf.records import Tick
from rw_ekf.sinks.run_files import Unwritten


class StateFileSink:
    """Publishes every tick that it is given."""

    def __init__(self, path: Path, about: dict[str, Any], unwritten: Unwritten, *, watched: bool) -> None:
        """watched: whether the document has alarms. unwritten: where what could not be published is counted."""
        self._path = path
        self._about = about
        self._unwritten = unwritten
        self._watched = watched

    def write(self, tick: Tick) -> None:
        """Replace the file."""
        estimate = tick.estimate
        document = {
            **self._about,
            "time_s": estimate.time_s,
            "outcome": estimate.outcome.value,
            "state": {**estimate.state._asdict(), **{name: c.value for name, c in estimate.effects.items()}},
            "std": {**estimate.std._asdict(), **{name: c.std for name, c in estimate.effects.items()}},
            "current_command_A": None if tick.command is None else tick.command.current_A,
            "temperature_degC": tick.sample.temperature_degC,
        }
        if self._watched:
            document["alarms"] = [alarm.document() for alarm in tick.alarms]
        try:
            write_text(self._path, json.dumps(document, indent=2, allow_nan=False) + "\n", follow=False)
        except (OSError, ValueError, RwEkfError):
            self._unwritten.state_files += 1  # it tells of the moment: the next one is tried, the log says why

    def close(self) -> None:
        """Nothing to finish."""
