"""When the ticks of a run came, and what time the wheel's clock has at a tick."""

from __future__ import annotations

from dataclasses import dataclass, field

from rw_ekf.records import WheelSample

_RATE_AFTER_S = 10.0  # sooner, milliseconds of jitter would pass for a clock that runs at another rate
_LATENESS_KEPT = 36_000  # an hour at 10 Hz: the percentiles are those of the last hour, and memory stays flat


@dataclass
class LoopTiming:
    """When the ticks came (the `loop` object of `run --json`)."""

    ticks: int = 0
    overruns: int = 0
    late_ms_max: float = 0.0
    late_ms: list[float] = field(default_factory=list)

    def note(self, late_s: float) -> None:
        """Note one tick that began late_s after its time."""
        late = 1e3 * max(late_s, 0.0)
        if len(self.late_ms) < _LATENESS_KEPT:
            self.late_ms.append(late)
        else:
            self.late_ms[self.ticks % _LATENESS_KEPT] = late
        self.ticks += 1
        self.late_ms_max = max(self.late_ms_max, late)

    def percentile_ms(self, share: float) -> float:
        """Percentile of the lateness [ms], nearest rank; 0.0 before the first tick."""
        if not self.late_ms:
            return 0.0
        ordered = sorted(self.late_ms)
        return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


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
        rate = 1.0  # of the wheel's clock against the host's, once there is enough to tell
        if self._last_tick_s - first_tick_s >= _RATE_AFTER_S:
            rate = (self.last.time_s - first.time_s) / (self._last_tick_s - first_tick_s)
        return WheelSample(self.last.time_s + (tick_s - self._last_tick_s) * rate, None, segment=self.last.segment)
