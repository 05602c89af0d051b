"""One row in so many of a log that is too long to be held, with what a filter says of each: enough for a picture."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rw_ekf.logs.wheel_log import WheelLog

_MOST_ROWS = 20_000  # ten to a pixel
_ARRAYS = ("time_s", "speed_rad_s", "current_A", "command_delay_s", "segment")


class ThinnedRows:
    """Takes rows as they come, and keeps few of them."""

    def __init__(self, rows: int) -> None:
        """rows: about, of the whole log."""
        self._every = max(1, -(-rows // _MOST_ROWS))
        self._passed = 0
        self._log: WheelLog | None = None
        self._kept: list[dict[str, Any]] = []

    def __call__(self, log: WheelLog, columns: dict[str, Any]) -> None:
        """Take the next rows of the log, and the columns (n,) that go with them."""
        chosen = slice(-self._passed % self._every, None, self._every)
        self._passed += len(log)
        self._log = self._log or replace(log.rows(slice(0)), channels={}, other={})
        own = {f"log.{name}": getattr(log, name) for name in _ARRAYS}
        self._kept.append({name: np.array(values[chosen]) for name, values in {**own, **columns}.items()})

    def taken(self) -> tuple[WheelLog, dict[str, Any]]:
        """The rows that were kept, without channels, and their columns. Raises ValueError where there were none."""
        if self._log is None:
            raise ValueError("no rows were taken")
        kept = {name: np.concatenate([part[name] for part in self._kept]) for name in self._kept[0]}
        own: dict[str, Any] = {name: kept.pop(f"log.{name}") for name in _ARRAYS}
        return replace(self._log, **own), kept
