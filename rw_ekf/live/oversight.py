"""Who watches a run from outside, and is told by every turn of the loop that has been completed."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.parent import die_with_parent
from rw_ekf.records import StateNow

TURN, OVER, TOLD = b".", b"o", b"t"


class Watchdog(Protocol):
    """Something outside that acts when a run no longer completes its turns. Neither call may raise or block."""

    def turned(self, state: StateNow | None) -> None:
        """A turn has been completed, all sinks included."""
        ...

    def over(self) -> None:
        """The loop has ended in order; zero was sent, and no turn will come any more."""
        ...


@dataclass(frozen=True)
class Oversight:
    """What a run owes to those who watch it, and has from them."""

    watchdogs: tuple[Watchdog, ...] = ()
    begin_safe: str | None = None  # why the run before, which died, was in SAFE

    def turned(self, state: StateNow | None) -> None:
        """Tell everyone that a turn has been completed."""
        for watchdog in self.watchdogs:
            watchdog.turned(state)

    def over(self) -> None:
        """Tell everyone that the loop has ended in order."""
        for watchdog in self.watchdogs:
            watchdog.over()


ALONE = Oversight()


class Heartbeat:
    """The child's end of the pipe to its supervisor: one byte a turn. A supervisor that has died is the run's end."""

    def __init__(self, descriptor: int, supervisor: int) -> None:
        """In the child, at once after the fork; supervisor: its process number."""
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor
        self._orphaned: Callable[[], None] = lambda: None
        die_with_parent(signal.SIGTERM)
        if os.getppid() != supervisor:  # it died before it could be asked
            os.kill(os.getpid(), signal.SIGTERM)

    def on_orphaned(self, stop: StopSignal, logger: Any) -> None:
        """Take what ends the run when nobody listens any more."""

        def end() -> None:
            logger.warning("supervisor_died", do="the run ends, with zero")
            stop.request("the supervisor's death")

        self._orphaned = end

    def turned(self, state: StateNow | None) -> None:
        """One byte."""
        self._write(TURN)

    def over(self) -> None:
        """The loop has ended in order."""
        self._write(OVER)

    def told(self) -> None:
        """What went wrong has been said to the user; nothing has crashed."""
        self._write(TOLD)

    def _write(self, byte: bytes) -> None:
        try:
            os.write(self._descriptor, byte)
        except BlockingIOError:
            pass  # the supervisor is not looking: it has been stopped, or the machine is slow
        except OSError:
            orphaned, self._orphaned = self._orphaned, lambda: None
            orphaned()
