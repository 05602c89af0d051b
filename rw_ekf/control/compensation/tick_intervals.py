"""What observers of friction need of a tick: how long since the one before, and which current drove the wheel."""

from __future__ import annotations

from rw_ekf.records import Tick, WheelSample


class Timeline:
    """Interval and driving current between the last two samples; None after a gap in time or a new segment."""

    def __init__(self, longest_s: float = 2.0) -> None:
        """longest_s: a longer interval is a gap, after which an observer starts afresh."""
        self._longest_s = longest_s
        self._last: WheelSample | None = None
        self._wanted_A = 0.0

    def step(self, tick: Tick) -> tuple[float, float] | None:
        """Interval [s] that ends with this tick's sample, and the current [A] in force at its end."""
        last, sample = self._last, tick.sample
        self._last = sample
        if last is None or last.segment != sample.segment:
            return None
        dt_s = sample.time_s - last.time_s
        if not 0.0 < dt_s <= self._longest_s:
            return None
        if sample.current_command_A is not None:
            return dt_s, sample.current_command_A
        return dt_s, self._wanted_A if sample.current_A is None else sample.current_A

    def wanted(self, current_A: float) -> float:
        """Note what was requested, for wheels whose telemetry has no current; returns it."""
        self._wanted_A = current_A
        return current_A


class Elapsed:
    """Time of the wheel from tick to tick; none passes where its clock began anew."""

    def __init__(self) -> None:
        self._last: WheelSample | None = None

    def step(self, tick: Tick) -> float:
        """Seconds since the tick before."""
        last, self._last = self._last, tick.sample
        if last is None or last.segment != tick.sample.segment:
            return 0.0
        return max(tick.sample.time_s - last.time_s, 0.0)
