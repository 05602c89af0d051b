"""Clients of a page's stream, as many as one likes, in one thread."""

from __future__ import annotations

import selectors
import socket
import threading
from typing import Self
from urllib.parse import urlsplit


class Clients:
    """So many that listen to a page's stream and throw away what comes."""

    def __init__(self, address: str, count: int) -> None:
        self.bytes = 0
        self._over = False
        place = urlsplit(address)
        self._selector = selectors.DefaultSelector()
        for _ in range(count):
            one = socket.create_connection((place.hostname, place.port))
            one.sendall(f"GET /api/live HTTP/1.1\r\nHost: {place.netloc}\r\n\r\n".encode())
            one.setblocking(False)
            self._selector.register(one, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._listen, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over = True
        self._thread.join()
        for key in list(self._selector.get_map().values()):
            assert isinstance(key.fileobj, socket.socket)
            key.fileobj.close()

    def _listen(self) -> None:
        while not self._over:
            for key, _ in self._selector.select(0.5):
                assert isinstance(key.fileobj, socket.socket)
                data = key.fileobj.recv(1 << 16)
                self.bytes += len(data)
                if not data:
                    self._selector.unregister(key.fileobj)
