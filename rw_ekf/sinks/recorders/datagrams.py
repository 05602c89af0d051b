"""Datagrams to one place, where anybody may listen or nobody."""

from __future__ import annotations

import contextlib
import socket

from rw_ekf.sinks.recorders.place import host_and_port


def udp_socket(place: str) -> socket.socket:
    """A socket that sends to HOST:PORT and never waits. Raises OSError for a name that is none."""
    host, port = host_and_port(place)
    family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    made = socket.socket(family, kind, protocol)
    made.setblocking(False)
    try:
        made.connect(address)
    except OSError:
        made.close()
        raise
    return made


def send(made: socket.socket, data: bytes) -> None:
    """Send one datagram; that nobody listens, or that there is no room, is what may happen to any. Raises OSError."""
    with contextlib.suppress(ConnectionError, BlockingIOError):
        made.send(data)
