"""One row in so many of a log that is too long to be held, with what a filter says of each: enough for a picture."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rw_ekf.logs.wheel_log import WheelLog, put_together

_MOST_ROWS = 20_000  # ten to a pixel


class ThinnedRows:
    """Takes rows as they come, and keeps few of them."""

    def __init__(self, rows: int) -> None:
        """rows: about, of the whole log."""
        self._every = max(1, -(-rows // _MOST_ROWS))
        self._passed = 0
        self._logs: list[WheelLog] = []
        self._columns: list[dict[str, Any]] = []

    def __call__(self, log: WheelLog, columns: dict[str, Any]) -> None:
        """Take the next rows of the log, and the columns (n,) that go with them."""
        chosen = np.arange(-self._passed % self._every, len(log), self._every)  # by number: copies, which hold no more
        self._passed += len(log)
        self._logs.append(replace(log, channels={}, other={}).rows(chosen))
        self._columns.append({name: values[chosen] for name, values in columns.items()})

    def taken(self) -> tuple[WheelLog, dict[str, Any]]:
        """The rows that were kept, without channels, and their columns. Raises ValueError where there were none."""
        if not self._logs:
            raise ValueError("no rows were taken")
        columns = {name: np.concatenate([part[name] for part in self._columns]) for name in self._columns[0]}
        return put_together(self._logs), columns
