"""Datagrams to one place, where anybody may listen or nobody."""

from __future__ import annotations

import socket
from collections.abc import Callable
from typing import Any, NamedTuple

from rw_ekf.sinks.recorders.late_place import LatePlace
from rw_ekf.sinks.run_files import Note


class _Way(NamedTuple):
    """A socket, and where it sends to."""

    socket: socket.socket
    address: Any

    @classmethod
    def to(cls, place: str) -> _Way:
        """The way to HOST:PORT. Raises OSError for a place that is none, or that nobody knows at this moment."""
        host, port = host_and_port(place)
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        except UnicodeError as error:  # a label that is empty, or longer than names may be
            raise OSError(None, f"{host} is no name of a host: {error}") from None
        sender = socket.socket(family, kind, protocol)
        sender.setblocking(False)
        return cls(sender, address)

    def close(self) -> None:
        """Send no more."""
        self.socket.close()


class Datagrams:
    """Sends and never waits. That nobody listens is no fault; what the system did not take is counted."""

    def __init__(self, sink: str, place: str, missed: Callable[[int, str], None], say: Note) -> None:
        """missed: called for ticks that were not sent, with why. say: called where the name of the place is waited for.

        Raises OSError for a HOST:PORT that is none.
        """
        self._way = LatePlace(sink, lambda: _Way.to(place), say)
        self._missed = missed

    def send(self, *datagrams: bytes) -> None:
        """Send what belongs to one tick."""
        way = self._way.had
        if way is None:
            self._missed(1, self._way.reason)
            return
        try:
            for data in datagrams:
                way.socket.sendto(data, way.address)
        except OSError as error:  # no room, no network, too long
            self._missed(1, error.strerror or str(error))

    def close(self) -> None:
        """Send no more."""
        self._way.close()


def host_and_port(place: str) -> tuple[str, int]:
    """Take HOST:PORT apart, brackets around an address of IPv6 removed."""
    host, _, port = place.rpartition(":")
    return host.strip("[]"), int(port)
