"""What systemd is told of a run (sd_notify, Type=notify): ready, how it stands, alive at the end of completed turns."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Mapping

from rw_ekf.clock import Clock
from rw_ekf.records import StateNow

_PINGS = 4.0  # as many in the time after which systemd takes the process for hung: between two, half of it never passes


class SystemdWatchdog:
    """Datagrams to systemd's socket. One that is not taken at once is dropped: nothing here ever waits or raises."""

    def __init__(self, address: str, hung_after_s: float | None, clock: Clock) -> None:
        """address: as in NOTIFY_SOCKET, "@" for an abstract one; hung_after_s: None where no pings are wanted."""
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._clock = clock
        self._every_s = None if hung_after_s is None else hung_after_s / _PINGS
        self._ping_at_s = 0.0
        self._told: StateNow | None = None
        self._ready = False

    def turned(self, state: StateNow | None) -> None:
        """READY at the first turn, whatever the wheel does: a restart would not help it; pings from then on."""
        words = []
        if not self._ready:
            words.append("READY=1")
        if state is not None and state is not self._told:
            words.append(f"STATUS={state.state.value}: {' '.join(state.reason.split())}")
        now = self._clock.monotonic()
        if self._every_s is not None and now >= self._ping_at_s:
            words.append("WATCHDOG=1")
        if words and self._send(words):
            self._ready, self._told = True, state
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
    """The one that an environment asks for; None where it asks for none."""
    address = environment.get("NOTIFY_SOCKET", "")
    if not address.startswith(("/", "@")):
        return None
    hung_after_s = None
    if environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid()):
        with contextlib.suppress(ValueError):
            hung_after_s = 1e-6 * int(environment.get("WATCHDOG_USEC", ""))
    return SystemdWatchdog(address, hung_after_s, clock)
