"""What time the wheel's clock has at a tick."""

from __future__ import annotations

from rw_ekf.records import WheelSample

_RATE_AFTER_S = 10.0  # sooner, milliseconds of jitter would pass for a clock that runs at another rate


class SampleTime:
    """The wheel's clock against the host's, so that a reading that did not come has the time it would have had."""

    def __init__(self) -> None:
        self.last: WheelSample | None = None
        self._last_tick_s = 0.0
        self._began: tuple[WheelSample, float] | None = None  # first sample of the segment, and its tick

    def note(self, sample: WheelSample, tick_s: float) -> None:
        """Note a reading and the host's time of its tick."""
        self.last, self._last_tick_s = sample, tick_s
        if self._began is None or self._began[0].segment != sample.segment:
            self._began = sample, tick_s

    def missing(self, tick_s: float) -> WheelSample | None:
        """A sample without a speed for a tick without a reply; None before the first reading."""
        if self.last is None or self._began is None:
            return None
        first, first_tick_s = self._began
        rate = 1.0  # of the wheel's clock against the host's, once there is enough to determine it
        if self._last_tick_s - first_tick_s >= _RATE_AFTER_S:
            rate = (self.last.time_s - first.time_s) / (self._last_tick_s - first_tick_s)
        return WheelSample(self.last.time_s + (tick_s - self._last_tick_s) * rate, None, segment=self.last.segment)
