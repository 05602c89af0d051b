"""Time as it is drawn: since the log's start, increasing throughout, in seconds or hours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array

_CLOCK_S = 1.0e5  # beyond it a clock's time, not a run's
_HOURS_FROM_S = 3.0 * 3600.0


@dataclass(eq=False, frozen=True)
class Timeline:
    """The time of every sample, and what its axis is called."""

    values: Float64Array  # (n,) in `unit`
    unit: str
    start_s: float = 0.0  # the log's own time where it starts
    continuous: bool = True  # it never restarts: the log's own time is `start_s` more throughout

    @property
    def unit_s(self) -> float:
        """Seconds of one unit."""
        return 3600.0 if self.unit == "h" else 1.0

    @property
    def own(self) -> float | None:
        """What to add for the log's own time, in `unit`; None where that is the same, another clock, or restarts."""
        shown = self.start_s != 0.0 and self.continuous and abs(self.start_s) <= _CLOCK_S
        return self.start_s / self.unit_s if shown else None

    @property
    def label(self) -> str:
        """Of an axis."""
        return f"time{' since the start' if self.start_s else ''} [{self.unit}]"

    @property
    def long_label(self) -> str:
        """The label, with the log's own time at its start where that is not zero."""
        places = 1 if abs(self.start_s) < _CLOCK_S else 0
        return f"{self.label}, which is at {self.start_s:.{places}f} s" if self.start_s else self.label


def timeline(time_s: Float64Array) -> Timeline:
    """Time since the first sample of (n,) time stamps [s]; where they restart, time continues by a usual step."""
    if time_s.size == 0:
        return Timeline(time_s, "s")
    step_s = np.diff(time_s)
    forward = step_s[step_s > 0.0]
    usual_s = float(np.median(forward)) if forward.size else 1.0
    drawn = time_s - time_s[0]
    shift = np.cumsum(np.where(step_s > 0.0, 0.0, usual_s - step_s))
    drawn[1:] += shift
    unit, unit_s = ("h", 3600.0) if drawn[-1] > _HOURS_FROM_S else ("s", 1.0)
    return Timeline(drawn / unit_s, unit, float(time_s[0]), continuous=bool(np.all(shift == 0.0)))
