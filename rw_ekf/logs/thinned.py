"""One row in so many of a log that is too long to be held, with what a filter says of each: enough for a picture."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rw_ekf.logs.wheel_log import WheelLog

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
        kept = slice(-self._passed % self._every, None, self._every)
        self._passed += len(log)
        thin = log.rows(kept)
        self._logs.append(replace(thin, channels={}, other={}))
        self._columns.append({name: np.array(values[kept]) for name, values in columns.items()})

    def taken(self) -> tuple[WheelLog, dict[str, Any]]:
        """The rows that were kept, without channels, and their columns."""
        logs = self._logs
        log = replace(
            logs[0],
            time_s=np.concatenate([log.time_s for log in logs]),
            speed_rad_s=np.concatenate([log.speed_rad_s for log in logs]),
            current_A=np.concatenate([log.current_A for log in logs]),
            command_delay_s=np.concatenate([log.command_delay_s for log in logs]),
            segment=np.concatenate([log.segment for log in logs]),
        )
        return log, {name: np.concatenate([part[name] for part in self._columns]) for name in self._columns[0]}
