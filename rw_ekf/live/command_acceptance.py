"""What becomes of commands: whether the wheel takes what is written, and what was not as requested.

A wheel takes what it neither refuses, nor leaves without an answer and unsaid by telemetry.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rw_ekf.driver import ACTED_THOUGH, TIMEOUT
from rw_ekf.records import IssuedCommand


def is_refused(issued: IssuedCommand) -> bool:
    """Whether the wheel reported that it will not have a current, and, as far as is known, has not taken it."""
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
        """Whether that has lasted too long."""
        return self.why is not None and now_s - self._since_s > self._longest_s


_OVER_AFTER_S = 10.0  # without it: as long as the slowest of what comes and goes by itself, a wheel about its limit


@dataclass
class _Train:
    """A reason that comes and goes."""

    last_s: float
    times: int = 1


class ChangedCommands:
    """Commands that were not what was requested, as events: one when that begins for a reason, then they are counted.

    A profile that rides on a limit, or a line that confirms nothing, changes its reason from turn to turn, for hours.
    One of these per wheel; time comes with the commands.
    """

    def __init__(self, note: Callable[..., None]) -> None:
        """note: receives the events."""
        self._note = note
        self._trains: dict[str, _Train] = {}
        self._reason: str | None = None  # of the last command

    def take(self, command: IssuedCommand, now_s: float) -> None:
        """Note what became of a command at now_s [s]."""
        self.end(now_s - _OVER_AFTER_S)
        reason, before, self._reason = command.reason, self._reason, command.reason
        if reason is None:
            return
        train = self._trains.get(reason)
        if train is None:
            self._trains[reason] = _Train(now_s)
            self._note("command_changed", reason=reason, current_A=command.current_A)
            return
        train.last_s = now_s
        train.times += reason != before

    def end(self, before_s: float) -> None:
        """Say how often those came again that were last seen before a time [s]."""
        for reason, train in [*self._trains.items()]:
            if train.last_s < before_s:
                del self._trains[reason]
                if train.times > 1:
                    self._note("command_changed_over", reason=reason, times=train.times)
