"""The wheel's own clock, made to run on: a counter that wraps, a wheel that restarts, a clock that jumps."""

from __future__ import annotations

from collections import deque

RATE_AFTER_S = 0.05
# By how much the clocks may disagree over an interval: a wheel whose telemetry is made ten times a second stamps a
# reading up to a period before it is requested, and no quartz is wrong by a fiftieth.
SLACK_S = 0.15
SLACK_SHARE = 0.02
# A clock is taken to run as the host's unless its first two seconds show that it does not, by more than this.
FIXED_AFTER_S = 2.0
SAME_RATE = 0.005
# A clock that has jumped so often within so many readings, or within such a time, is not a clock.
MOST_JUMPS, AMONG_READINGS = 3, 20
MOST_IN_TIME, WITHIN_S = 8, 60.0


class WheelClock:
    """Turns uptime readings into time that never wraps, and a number of segments that counts restarts and jumps.

    The clock is believed while it agrees with the host's. With u the uptime of a reading that was requested at h- and
    had come at h+ of the host's clock, and r wheel seconds per host second,

        r (h-_i - h+_j) - e  <=  u_i - u_j  <=  r (h+_i - h-_j) + e,      e = r (0.15 s + 2 % of h+_i - h-_j)

    must hold between readings j and i, however long the host was stopped in between: the reading was taken at some
    time while it was waited for; j is the reading before, and the first of the segment. Where it does not, the clock
    has jumped, and a new segment begins. r is 1, or, in a simulation that runs at another rate, what a clock shows in
    its first two seconds. A clock that jumps again and again is not believed any more: from then on the host counts.
    """

    def __init__(self) -> None:
        self.segment = 0
        self.rate = 1.0  # wheel seconds per host second; a simulated wheel may run fast
        self.believed = True
        self.news: tuple[str, str] | None = None  # event and sentence of what the last reading brought
        self._uptime_s: float | None = None
        self._wanted_s = self._came_s = 0.0  # of the last reading, by the host
        self._time_s = 0.0
        self._wraps_s = 0.0
        self._turned: float | None = None  # as last reported
        self._restart_noted = False
        self._flag_expected = False  # a restart was seen by uptime; the flag that says the same is still to come
        self._began: tuple[float, float, float] | None = None  # the segment's first: its time, requested at, came at
        self._nominal = 1.0  # the rate that intervals are compared with
        self._settled = False  # whether an interval has agreed with it
        self._fixed = False  # whether it has been found for good
        self._candidate: float | None = None
        self._jumped: deque[bool] = deque(maxlen=AMONG_READINGS)
        self._jumped_at_s: deque[float] = deque(maxlen=MOST_IN_TIME)  # by the host's clock

    def note_restart(self) -> None:
        """The wheel itself says that it restarted (status flag): the next reading starts a new segment, once.

        Not where the uptime has shown that restart already.
        """
        self._restart_noted = self._uptime_s is not None and not self._flag_expected
        self._flag_expected = False

    def note_turned(self, turned: float, span: float) -> None:
        """What the wheel has turned since it was powered, either way, which wraps after `span`: a fall is a restart.

        For a wheel that reports no uptime.
        """
        if self._turned is not None and 0.0 < self._turned - turned < 0.5 * span:
            self.begin_segment("wheel_restarted", "the wheel restarted: it has turned less than before")
        self._turned = turned

    def begin_segment(self, event: str, text: str) -> None:
        """Start a new segment for a reason that the uptime does not show."""
        self.segment += 1
        self._began = None
        self.news = event, text

    def time_s(
        self, uptime_s: float, wanted_s: float, span_s: float | None, came_s: float | None = None, count_s: float = 0.0
    ) -> float:
        """Wheel time [s] of an uptime reading [s] requested at `wanted_s` and here at `came_s` [s] of the host's clock.

        span_s: after how much the counter wraps; None where it does not. count_s: its resolution. The same uptime again
        is the same time again: that reading is no later than the one before.
        """
        came_s = wanted_s if came_s is None else max(came_s, wanted_s)
        self.news = None
        if self._uptime_s is None:
            return self._take(uptime_s, wanted_s, came_s)
        if uptime_s == self._uptime_s and not self._restart_noted:
            return self._time_s
        advance_s = uptime_s - self._uptime_s
        least_s, most_s = max(wanted_s - self._came_s, 0.0), came_s - self._wanted_s
        if advance_s < 0.0 and span_s is not None and not self._restart_noted:
            wrapped_s = advance_s + span_s
            unsettled = not self._settled and wrapped_s <= 10.0 * most_s + 10.0
            if unsettled or self._agrees(wrapped_s, least_s, most_s, self._nominal, count_s):
                self._wraps_s += span_s
                advance_s = wrapped_s
        small = uptime_s <= self._nominal * (most_s + SLACK_S) + count_s
        if self._restart_noted or (self.believed and advance_s < 0.0 and small):
            self._flag_expected = advance_s < 0.0 and not self._restart_noted
            self._start_over("wheel_restarted", f"the wheel restarted: its uptime is {uptime_s:.3f} s")
        elif self.believed and not self._consistent(advance_s, least_s, most_s, count_s):
            self._jump(advance_s, most_s, wanted_s)
        return self._take(uptime_s, wanted_s, came_s)

    def between_s(self, wanted_s: float) -> float:
        """Wheel time [s] of a reading that came without its uptime, requested at `wanted_s` [s] of the host's clock."""
        return self._time_s + self.rate * max(wanted_s - self._wanted_s, 0.0)

    def _take(self, uptime_s: float, wanted_s: float, came_s: float) -> float:
        """Keep a reading as the last one; its time."""
        if self.believed:
            self._time_s = uptime_s + self._wraps_s
        else:
            self._time_s += max(wanted_s - self._wanted_s, 0.0)
        self._restart_noted = False
        self._uptime_s, self._wanted_s, self._came_s = uptime_s, wanted_s, came_s
        self._measure_rate(self._time_s, wanted_s)
        return self._time_s

    def _consistent(self, advance_s: float, least_s: float, most_s: float, count_s: float) -> bool:
        """Whether an interval agrees with the host's clock; the first ones may find another rate."""
        agrees = advance_s > 0.0 and self._agrees(advance_s, least_s, most_s, self._nominal, count_s)
        so_far = self._rate_so_far  # short intervals agree with any rate, and a late one only with the clock's own
        if not agrees and not self._fixed and advance_s > 0.0:
            agrees = self._agrees(advance_s, least_s, most_s, so_far, count_s)
            self._nominal = so_far if agrees else self._nominal
        if self._fixed and self._began is not None and agrees:
            began_s, began_wanted_s, began_came_s = self._began
            total_s, shift_s = self._time_s + advance_s - began_s, self._wanted_s - began_wanted_s
            least_s += self._came_s - began_came_s if began_came_s < self._came_s else 0.0
            agrees = self._agrees(total_s, least_s, most_s + shift_s, self._nominal, count_s)
        first = not self._settled and self._candidate is None
        if not agrees and not self._settled and advance_s > 0.0 and most_s > 0.0:
            if self._candidate is not None and self._agrees(advance_s, least_s, most_s, self._candidate, count_s):
                self._nominal, agrees = self._candidate, True
            else:
                self._candidate = advance_s / (0.5 * (least_s + most_s))
        if agrees and not self._settled:
            self._settled = True
            if self._candidate is not None:
                self._began = None  # what came before may have been a jump
        accepted = agrees or (first and advance_s > 0.0)  # one interval cannot distinguish a jump from a fast clock
        self._jumped.append(not accepted)
        return accepted

    @property
    def _rate_so_far(self) -> float:
        """Since the segment began, however short that is."""
        if self._began is None or self._wanted_s <= self._began[1]:
            return self._nominal
        return (self._time_s - self._began[0]) / (self._wanted_s - self._began[1])

    @staticmethod
    def _agrees(advance_s: float, least_s: float, most_s: float, rate: float, count_s: float) -> bool:
        slack_s = rate * (SLACK_S + SLACK_SHARE * most_s) + 2.0 * count_s
        return rate * least_s - slack_s <= advance_s <= rate * most_s + slack_s

    def _jump(self, advance_s: float, most_s: float, host_s: float) -> None:
        self._jumped_at_s.append(host_s)
        at_s, within = self._jumped_at_s, ""
        if len(at_s) == MOST_IN_TIME and at_s[-1] - at_s[0] < WITHIN_S:
            within = f"{MOST_IN_TIME} jumps within {at_s[-1] - at_s[0]:.0f} s"
        if sum(self._jumped) >= MOST_JUMPS:
            within = f"{MOST_JUMPS} jumps within {AMONG_READINGS} readings"
        if within:
            self.believed, self.rate = False, 1.0
            self._start_over(
                "clock_not_believed",
                f"the wheel's clock does not agree with this computer's ({within}): from here on time is counted by "
                "this computer",
            )
            return
        passed = f"{advance_s:+.3f} s while {most_s:.3f} s passed here"
        self._start_over("clock_jumped", f"the wheel's clock jumped ({passed}): a new segment begins")

    def _start_over(self, event: str, text: str) -> None:
        self._wraps_s = 0.0
        self.begin_segment(event, text)

    def _measure_rate(self, time_s: float, host_s: float) -> None:
        """Compare the clocks since the segment began; readings a millisecond coarse need some tens to say anything."""
        if self._began is None:
            self._began = (time_s, host_s, self._came_s)
            return
        total_s, passed_s = time_s - self._began[0], host_s - self._began[1]
        if passed_s > FIXED_AFTER_S and self._settled and not self._fixed:
            least_s, most_s = host_s - self._began[2], self._came_s - self._began[1]
            same = (1.0 - SAME_RATE) * least_s <= total_s <= (1.0 + SAME_RATE) * most_s
            self._nominal, self._fixed = 1.0 if same else total_s / passed_s, True
        if passed_s > RATE_AFTER_S and self.believed:
            self.rate = self._rate_so_far
