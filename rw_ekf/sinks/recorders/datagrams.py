"""Datagrams to one place, where anybody may listen or nobody."""

from __future__ import annotations

import socket
from collections.abc import Callable


class Datagrams:
    """Sends and never waits. That nobody listens is no fault; what the system did not take is counted."""

    def __init__(self, place: str, missed: Callable[[int, str], None]) -> None:
        """missed: called for ticks that were not sent, with why. Raises OSError for a HOST:PORT that is none."""
        host, port = host_and_port(place)
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        self._address = address
        self._missed = missed
        self._socket = socket.socket(family, kind, protocol)
        self._socket.setblocking(False)

    def send(self, *datagrams: bytes) -> None:
        """Send what belongs to one tick."""
        try:
            for data in datagrams:
                self._socket.sendto(data, self._address)
        except OSError as error:  # no room, no network, too long
            self._missed(1, error.strerror or str(error))

    def close(self) -> None:
        """Send no more."""
        self._socket.close()


def host_and_port(place: str) -> tuple[str, int]:
    """Take HOST:PORT apart, brackets around an address of IPv6 removed. Raises OSError for a port that is none."""
    host, _, port = place.rpartition(":")
    if int(port) > 65535:
        raise OSError(None, f"{port} is no port, the largest is 65535")
    return host.strip("[]"), int(port)
