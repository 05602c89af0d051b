"""The last hour of a run in memory, so that its end can judge the residual without reading a month of log."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rw_ekf.course.course import Course
from rw_ekf.model.law import MOST_COLUMNS
from rw_ekf.records import Outcome, Tick, WheelSample

if TYPE_CHECKING:
    from rw_ekf.arrays import Float64Array

_LONGEST_S = 3600.0
_MOST_ROWS = 36_000  # an hour at 10 Hz, 2 MB; of a faster loop so many samples
_COLUMNS = 7 + MOST_COLUMNS


class RecentSink:
    """Keeps the newest rows as the log has them, in a ring: nothing grows after it has been filled once."""

    def __init__(self, rate_hz: float = 10.0, columns: Sequence[str] = ()) -> None:
        """rate_hz: of the loop. columns: of samples, that learned laws of the model are functions of."""
        self._names = columns
        self._rows: Float64Array = np.zeros((max(round(min(rate_hz * _LONGEST_S, _MOST_ROWS)), 1), _COLUMNS))
        self._count = 0
        self._current_A = 0.0

    def write(self, tick: Tick) -> None:
        """Keep one row."""
        sample, command = tick.sample, tick.command
        if tick.estimate.outcome in (Outcome.REPEATED, Outcome.BACKWARD):
            return
        current_A = sample.current_command_A if command is None else command.current_A
        if current_A is not None:
            self._current_A = current_A
        self._rows[self._count % len(self._rows)] = (
            sample.time_s,
            np.nan if sample.speed_rad_s is None else sample.speed_rad_s,
            self._current_A,
            0.0 if command is None else command.delay_s,
            sample.segment,
            np.nan if sample.temperature_degC is None else sample.temperature_degC,
            np.nan if sample.angle_rad is None else sample.angle_rad,
            *self._further(sample),
        )
        self._count += 1

    def _further(self, sample: WheelSample) -> list[float]:
        values = [getattr(sample, name, None) for name in self._names]
        known = [np.nan if value is None else float(value) for value in values]
        return [*known, *[np.nan] * (MOST_COLUMNS - len(known))]

    def close(self) -> None:
        """Nothing to finish."""

    @property
    def is_whole(self) -> bool:
        """Whether it is the run from its beginning."""
        return self._count <= len(self._rows)

    def course(self) -> Course:
        """Return the rows kept, oldest first."""
        begin = 0 if self.is_whole else self._count % len(self._rows)
        rows = np.roll(self._rows[: self._count], -begin, axis=0)
        time_s, speed, current_A, delay_s, segment, temperature, angle = (np.array(column) for column in rows.T[:7])
        further = np.array(rows[:, 7:]) if self._names else None
        return Course.of(time_s, speed, current_A, delay_s, segment.astype(np.int64), temperature, angle, further)
