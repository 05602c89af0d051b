"""The wheel's own clock, made to run on: a counter that wraps, and a wheel that restarts."""

from __future__ import annotations

RATE_AFTER_S = 0.05


class WheelClock:
    """Turns uptime readings into time that never wraps, and a number of segments that counts restarts."""

    def __init__(self) -> None:
        self.segment = 0
        self._uptime_s: float | None = None
        self._host_s = 0.0
        self._wraps_s = 0.0
        self._restart_noted = False
        self._flag_expected = False  # a restart was seen by uptime; the flag that says the same is still to come
        self._began: tuple[float, float] | None = None  # wheel time and host time of the segment's first reading
        self.rate = 1.0  # wheel seconds per host second; a simulated wheel may run fast

    def note_restart(self) -> None:
        """The wheel itself says that it restarted (status flag): the next reading starts a new segment, once.

        Not where the uptime has told of that restart already.
        """
        self._restart_noted = self._uptime_s is not None and not self._flag_expected
        self._flag_expected = False

    def time_s(self, uptime_s: float, host_s: float, span_s: float | None) -> float:
        """Wheel time [s] of an uptime reading [s] taken at `host_s` [s] of the host's clock.

        span_s: after how much the counter wraps; None where it does not. A jump back is a wrap when counting on through
        the wrap fits the time that passed here, else the wheel has restarted.
        """
        if self._uptime_s is not None:
            back = uptime_s < self._uptime_s
            passed_s = host_s - self._host_s
            wrapped = back and span_s is not None and uptime_s - self._uptime_s + span_s <= 10.0 * passed_s + 10.0
            if wrapped and span_s is not None and not self._restart_noted:
                self._wraps_s += span_s
            elif back or self._restart_noted:
                self._flag_expected = back and not self._restart_noted
                self.segment += 1
                self._wraps_s = 0.0
                self._began = None
        self._restart_noted = False
        self._uptime_s, self._host_s = uptime_s, host_s
        time_s = uptime_s + self._wraps_s
        self._measure_rate(time_s, host_s)
        return time_s

    def _measure_rate(self, time_s: float, host_s: float) -> None:
        """Compare the clocks since the segment began; readings a millisecond coarse need some tens to say anything."""
        if self._began is None:
            self._began = (time_s, host_s)
            return
        passed_s = host_s - self._began[1]
        if passed_s > RATE_AFTER_S:
            self.rate = (time_s - self._began[0]) / passed_s
