"""Whether the wheel takes what is written: neither refused, nor left without an answer and unsaid by telemetry."""

from __future__ import annotations

from rw_ekf.driver import ACTED_THOUGH, TIMEOUT
from rw_ekf.records import IssuedCommand


def is_refused(issued: IssuedCommand) -> bool:
    """Whether the wheel said that it will not have a current, and, as far as is known, has not taken it."""
    reason = issued.reason
    if reason is None:
        return not issued.acknowledged
    return reason != TIMEOUT and not reason.startswith(ACTED_THOUGH)


class Heeding:
    """Since when no current was taken, and why."""

    def __init__(self, longest_s: float) -> None:
        """longest_s: after so long nothing but zero is tried, until one is taken."""
        self.why: str | None = None  # None: the last write was taken
        self._longest_s = longest_s
        self._since_s = 0.0

    def note(self, current_A: float, issued: IssuedCommand, now_s: float) -> None:
        """Note what became of a write."""
        if issued.reason != TIMEOUT and (current_A == 0.0 or not is_refused(issued)):
            self.why = None
        elif self.why is None:
            self.why, self._since_s = issued.reason or "refused", now_s

    def is_over(self, now_s: float) -> bool:
        """Whether that has gone on too long."""
        return self.why is not None and now_s - self._since_s > self._longest_s
