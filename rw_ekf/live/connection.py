"""The line to a wheel over a run: opened, lost, opened again with zero first, given zero at the end."""

from __future__ import annotations

from collections.abc import Callable

from rw_ekf.clock import Clock
from rw_ekf.driver import WheelDriver
from rw_ekf.errors import DriverError
from rw_ekf.live.guard import CurrentGuard, SafetyLimits, Say

_REOPEN_EVERY_S = 0.2  # cheap where the name of the device is not back yet
_LAST_TRY_S = 2.0
_LAST_TRY_EVERY_S = 0.1

Opener = Callable[[WheelDriver | None], WheelDriver]  # given the wheel that was lost, its clock and counters continue
Note = Callable[..., None]  # receives named events for the log, e.g. note("link_lost", reason="...")


class Connection:
    """One wheel behind its guard, whatever becomes of the line in between."""

    def __init__(
        self,
        open_wheel: Opener,
        limits: SafetyLimits,
        clock: Clock,
        note: Note,
        *,
        writes: bool,
        speed_step_rad_s: float,
        back_at_zero_within_s: float,
        say: Say,
    ) -> None:
        """Open the line (DriverError if that fails) and, where this run writes at all, command zero.

        back_at_zero_within_s: how long zero is tried on a line that is back [s]. say: takes what was found about the
        wheel, as an event and a sentence.
        """
        self._open = open_wheel
        self._clock = clock
        self._note = note
        self._writes = writes
        self._back_at_zero_within_s = back_at_zero_within_s
        self.driver = open_wheel(None)
        self.guard = CurrentGuard(self.driver, limits, clock, speed_step_rad_s, say)
        self.lost = False
        self._retry_at_s = 0.0
        self.zero()

    def zero(self, within_s: float = 0.5) -> bool:
        """Command zero, unless this run never writes; True if the wheel confirmed it within_s [s]."""
        return self._writes and self.guard.zero(within_s)

    def lose(self, error: DriverError) -> None:
        """Note that the line has failed."""
        if not self.lost:
            self._note("link_lost", reason=str(error))
        self.lost = True
        self.driver.link.trouble = str(error)
        self._retry_at_s = self._clock.monotonic()

    def is_up(self) -> bool:
        """Whether the line is there; a lost one is opened again now and then, and zero is the first thing on it."""
        if not self.lost:
            return True
        if self._clock.monotonic() < self._retry_at_s:
            return False
        self._retry_at_s = self._clock.monotonic() + _REOPEN_EVERY_S
        if not self._reopen():
            return False
        self.lost = False
        self.driver.link.trouble = None
        self.zero(self._back_at_zero_within_s)
        self._note("link_back", reconnects=self.driver.link.reconnects)
        return True

    def close(self) -> bool:
        """Command zero (unless this run never writes) and release the line; False if the wheel did not confirm it.

        The last resort is a new line: one that was pulled out may be back within a moment.
        """
        confirmed = not self._writes or (not self.lost and self.guard.stand_down()) or self._zero_over_new_line()
        self.driver.close()
        return confirmed

    def _reopen(self) -> bool:
        try:
            self.driver = self.guard.driver = self._open(self.driver)
        except DriverError:
            return False
        return True

    def _zero_over_new_line(self) -> bool:
        end_s = self._clock.monotonic() + _LAST_TRY_S
        while not self._reopen():
            if self._clock.monotonic() >= end_s:
                return False
            self._clock.sleep(_LAST_TRY_EVERY_S)
        return self._writes and self.guard.stand_down(1.0)
