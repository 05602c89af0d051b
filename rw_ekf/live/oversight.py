"""Who watches a run from outside, and is notified of every completed turn of the loop."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from rw_ekf.clock import Clock
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.parent_process import die_with_parent
from rw_ekf.records import StateNow

TURN, OVER, REPORTED = b".", b"o", b"t"
_PINGS = 4.0  # as many in the time after which systemd takes the process for hung: between two, half of it never passes


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
        if os.getppid() != supervisor:  # it died before that was set up
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

    def reported(self) -> None:
        """What went wrong has been reported to the user; nothing has crashed."""
        self._write(REPORTED)

    def _write(self, byte: bytes) -> None:
        try:
            os.write(self._descriptor, byte)
        except BlockingIOError:
            pass  # the supervisor is not looking: it has been stopped, or the machine is slow
        except OSError:
            orphaned, self._orphaned = self._orphaned, lambda: None
            orphaned()


class SystemdWatchdog:
    """Tells systemd (sd_notify, Type=notify): ready, how it stands, alive at the end of completed turns.

    Datagrams to its socket. One that is not taken at once is dropped: nothing here ever waits or raises.
    """

    def __init__(self, address: str, hung_after_s: float | None, clock: Clock) -> None:
        """address: as in NOTIFY_SOCKET, "@" for an abstract one; hung_after_s: None where no pings are wanted."""
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._clock = clock
        self._every_s = None if hung_after_s is None else hung_after_s / _PINGS
        self._ping_at_s = 0.0
        self._reported: StateNow | None = None
        self._ready = False

    def turned(self, state: StateNow | None) -> None:
        """READY at the first turn, whatever the wheel does: a restart would not help it; pings from then on."""
        words = []
        if not self._ready:
            words.append("READY=1")
        if state is not None and state is not self._reported:
            words.append(f"STATUS={state.state.value}: {' '.join(state.reason.split())}")
        now = self._clock.monotonic()
        if self._every_s is not None and now >= self._ping_at_s:
            words.append("WATCHDOG=1")
        if words and self._send(words):
            self._ready, self._reported = True, state
            if self._every_s is not None:
                self._ping_at_s = now + self._every_s

    def over(self) -> None:
        """No pings any more: from here on systemd counts its own time for the end."""
        self._send(["STOPPING=1", "STATUS=the loop is over, zero was sent"])

    def _send(self, words: list[str]) -> bool:
        kind = socket.SOCK_DGRAM | socket.SOCK_CLOEXEC | socket.SOCK_NONBLOCK
        with contextlib.suppress(OSError, ValueError), socket.socket(socket.AF_UNIX, kind) as line:
            line.sendto("\n".join(words).encode(), self._address)
            return True
        return False


def systemd_of(environment: Mapping[str, str], clock: Clock) -> SystemdWatchdog | None:
    """The one that an environment requests; None where it requests none."""
    address = environment.get("NOTIFY_SOCKET", "")
    if not address.startswith(("/", "@")):
        return None
    hung_after_s = None
    if environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid()):
        with contextlib.suppress(ValueError):
            hung_after_s = 1e-6 * int(environment.get("WATCHDOG_USEC", ""))
    return SystemdWatchdog(address, hung_after_s, clock)
