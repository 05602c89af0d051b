"""A broker of MQTT 3.1.1 that speaks as much of it as a publisher needs, wills and retained messages included.

Written from the standard (docs.oasis-open.org/mqtt/mqtt/v3.1.1), without the library that it tests.
"""

from __future__ import annotations

import contextlib
import socket
import threading
from dataclasses import dataclass, field

CONNECT, PUBLISH, PINGREQ, DISCONNECT = 1, 3, 12, 14


@dataclass
class Broker:
    """Takes connections until it is gone."""

    port: int = 0
    published: list[tuple[str, str]] = field(default_factory=list)
    retained: dict[str, str] = field(default_factory=dict)
    connects: int = 0
    _connections: list[socket.socket] = field(default_factory=list)

    def begin(self) -> None:
        """Listen, at the same port as before."""
        self._socket = socket.create_server(("127.0.0.1", self.port))
        self.port = self._socket.getsockname()[1]
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    def vanish(self) -> None:
        """Every connection is cut, and nobody listens."""
        self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self._thread.join(5.0)
        self.cut()

    def cut(self) -> None:
        """Every connection is cut."""
        while self._connections:
            connection = self._connections.pop()
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._socket.accept()
                self._connections.append(connection)
                threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        will: tuple[str, str] | None = None
        with contextlib.suppress(OSError, EOFError), connection:
            while True:
                kind, flags, body = _packet(connection)
                if kind == CONNECT:
                    self.connects += 1
                    will = _will(body)
                    connection.sendall(b"\x20\x02\x00\x00")
                elif kind == PUBLISH:
                    topic, rest = _text(body)
                    if flags & 6:
                        connection.sendall(b"\x40\x02" + rest[:2])
                        rest = rest[2:]
                    self.published.append((topic, rest.decode()))
                    if flags & 1:
                        self.retained[topic] = rest.decode()
                elif kind == PINGREQ:
                    connection.sendall(b"\xd0\x00")
                elif kind == DISCONNECT:
                    will = None
                    return
        if will is not None:
            self.retained[will[0]] = will[1]


def _packet(connection: socket.socket) -> tuple[int, int, bytes]:
    head = _exactly(connection, 1)[0]
    length = shift = 0
    while True:
        digit = _exactly(connection, 1)[0]
        length |= (digit & 0x7F) << shift
        shift += 7
        if not digit & 0x80:
            return head >> 4, head & 0x0F, _exactly(connection, length)


def _exactly(connection: socket.socket, length: int) -> bytes:
    data = b""
    while len(data) < length:
        piece = connection.recv(length - len(data))
        if not piece:
            raise EOFError
        data += piece
    return data


def _text(data: bytes) -> tuple[str, bytes]:
    length = int.from_bytes(data[:2], "big")
    return data[2 : 2 + length].decode(), data[2 + length :]


def _will(body: bytes) -> tuple[str, str] | None:
    """Topic and message that a CONNECT leaves, which has to be retained."""
    name, rest = _text(body)
    assert name == "MQTT"
    flags = rest[1]
    _, rest = _text(rest[4:])  # client
    if not flags & 0x04:
        return None
    assert flags & 0x20, "the will is not retained"
    topic, rest = _text(rest)
    message, _ = _text(rest)
    return topic, message
