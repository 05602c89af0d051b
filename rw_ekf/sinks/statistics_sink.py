"""Running statistics, flat in memory."""

from __future__ import annotations

from rw_ekf.records import Tick
from rw_ekf.statistics import RunStatistics


class StatisticsSink:
    """Counts every tick."""

    def __init__(self, statistics: RunStatistics) -> None:
        self._statistics = statistics
        self._segment: int | None = None

    def write(self, tick: Tick) -> None:
        """Count one tick."""
        self._statistics.add(tick.estimate, same_segment=tick.sample.segment == self._segment)
        self._segment = tick.sample.segment

    def close(self) -> None:
        """Nothing to finish."""
