"""One page of text over HTTP: a thread of its own, a few connections, seconds for each."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
from collections.abc import Callable

from rw_ekf.sinks.recorders.datagrams import host_and_port

_MOST_OPEN = 32
_WITHIN_S = 3.0  # a connection is over, whatever the client does
_LONGEST_REQUEST = 8192  # bytes
_CLOSE_WITHIN_S = 1.0


class TextServer:
    """Answers GET of one path. A client that stalls, floods or speaks anything else costs nobody but itself."""

    def __init__(self, place: str, path: str, page: Callable[[], str], content_type: str) -> None:
        """Listen at HOST:PORT. page: called for each request. Raises OSError if the place cannot be had."""
        host, port = host_and_port(place)
        self._socket = socket.create_server(
            (host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET, backlog=_MOST_OPEN
        )
        self.port: int = self._socket.getsockname()[1]
        self._path = path
        self._page = page
        self._type = content_type
        self._open = 0
        self._loop = asyncio.new_event_loop()
        self._over = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name=f"text-server-{self.port}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End every connection, and listen no more. Safe to call twice."""
        with contextlib.suppress(RuntimeError):  # the loop is closed already
            self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join(_CLOSE_WITHIN_S)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())

    async def _serve(self) -> None:
        server = await asyncio.start_server(self._connected, sock=self._socket, limit=_LONGEST_REQUEST)
        await self._over.wait()
        server.close()

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._open += 1
        try:
            if self._open <= _MOST_OPEN:
                async with asyncio.timeout(_WITHIN_S):
                    head = await reader.readuntil(b"\r\n\r\n")
                    writer.write(self._answer(head.split(b"\r\n", 1)[0]))
                    await writer.drain()
                    writer.close()
                    await writer.wait_closed()
        except (OSError, TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass  # it has gone, or sent nothing that is a request
        finally:
            self._open -= 1
            writer.transport.abort()

    def _answer(self, request: bytes) -> bytes:
        method, _, rest = request.decode("latin-1").partition(" ")
        target = rest.partition(" ")[0].partition("?")[0]
        if method not in ("GET", "HEAD"):
            return _response("405 Method Not Allowed", "text/plain", "GET alone is answered\n")
        if target != self._path:
            return _response("404 Not Found", "text/plain", f"the page is {self._path}\n")
        try:
            whole = _response("200 OK", self._type, self._page())
        except Exception as error:  # noqa: BLE001 - whatever it is, the client is notified, and may request again
            return _response("500 Internal Server Error", "text/plain", f"{type(error).__name__}: {error}\n")
        return whole if method == "GET" else whole.partition(b"\r\n\r\n")[0] + b"\r\n\r\n"


def _response(status: str, kind: str, body: str) -> bytes:
    data = body.encode()
    head = f"HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {len(data)}\r\nConnection: close\r\n\r\n"
    return head.encode() + data
