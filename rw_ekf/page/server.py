"""The page's server: files of the page, a run's history, and what comes new as server-sent events.

It reads files and nothing else; the run knows nothing of it. A client that does not keep up loses what it missed, and
is instructed to request the history again.
"""

from __future__ import annotations

import asyncio
import ipaddress
import json
import math
import secrets
from collections.abc import AsyncIterator, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send

from rw_ekf.errors import BadInputError
from rw_ekf.page.diagnosis_on_request import Reports
from rw_ekf.page.run_feed import POINTS, Believed, RunFeed, RunTail, believed_of, runs_in

STATIC = Path(__file__).parent / "static"
_FILES = {"page.js": "text/javascript", "panes.js": "text/javascript", "page.css": "text/css",
          "uPlot.iife.min.js": "text/javascript", "uPlot.min.css": "text/css"}  # fmt: skip
_STILL_HERE_S = 15.0  # a connection on which nothing comes for longer may be given up on its way
_LOOK_S, _STATE_S, _CURVE_S = 0.5, 1.0, 5.0  # of each look most is the waking of threads and clients
_QUEUE = 64  # messages a client may be behind: some 20 s
_OVER = b""  # the last message
_MOST_CLIENTS = 200
_MOST_POINTS = 20_000
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS = {
    "content-security-policy": _POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
}


# A report is one file with its own style; it has no script, and what it held would be run by none.
_OF_REPORT = {
    "content-security-policy": "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
}


@dataclass(frozen=True)
class Access:
    """Who may send requests: by the name that a request was sent to, and by a token."""

    host: str  # that is listened on
    token: str
    wanted_always: bool  # else only for what changes something

    @classmethod
    def of(cls, host: str) -> Access:
        """Without a token where only this machine can send requests."""
        return cls(host, secrets.token_urlsafe(16), not _is_loopback(host))

    def allows_host(self, header: str) -> bool:
        """Whether a request was sent to this machine by a name of its own: else a page elsewhere sent it."""
        name = header.rsplit(":", 1)[0] if not header.endswith("]") else header
        bare = name.strip("[]").lower()
        if bare in {"localhost", self.host.lower()} or _is_loopback(bare):
            return True
        return self.wanted_always and _is_address(bare)  # a name that is turned to another address is none

    def has_token(self, request: Request) -> bool:
        """Whether a request bears the token."""
        return secrets.compare_digest(request.headers.get("x-token", "").encode(), self.token.encode())


@dataclass(eq=False)
class Place:
    """What is shown: runs, or the runs of folders; and how the wheel is stopped from here, if at all."""

    paths: Sequence[Path]
    stop: Callable[[], dict[str, Any]] | None = None
    wheels: int = 1  # that are stopped, where there is one line for several
    stopping: int = 0  # stops that are being waited for
    watchers: dict[str, Watcher] = field(default_factory=dict)
    reports: Reports = field(default_factory=Reports)
    # A thread of its own: a stop waits neither behind what others request, nor for the run's priority over the page.
    stopper: ThreadPoolExecutor = field(default_factory=lambda: ThreadPoolExecutor(1, "stop"))

    def close(self) -> None:
        """Let go of who is connected, and end the report that is being made. Safe to call twice."""
        for watcher in self.watchers.values():
            watcher.end()
        self.reports.close()

    def runs(self) -> list[Path]:
        """The runs there are now, the newest first."""
        found = [run for path in self.paths for run in (runs_in(path) if path.is_dir() else [path])]
        return sorted(found, key=lambda run: run.name, reverse=True)

    def feed(self, name: str) -> RunFeed:
        """The run of that name; the newest for none. Raises BadInputError where there is no such run."""
        for path in self.runs():
            feed = RunFeed(path)
            if name in ("", feed.name):
                return feed
        place = ", ".join(map(str, self.paths))
        raise BadInputError(f"there is no run '{name}' in {place}" if name else f"no run yet in {place}")


class Watcher:
    """Looks at one run for all who watch it, while anyone does."""

    def __init__(self, feed: RunFeed) -> None:
        self.clients: set[asyncio.Queue[bytes]] = set()
        self._silent_looks = 0
        self._last_state: list[bytes] = []
        self.top_rad_s = 1.0  # up to which friction is shown, as last requested
        self._feed = feed
        self._task: asyncio.Task[None] | None = None

    @asynccontextmanager
    async def client(self) -> AsyncIterator[asyncio.Queue[bytes]]:
        """A queue of messages, until the client has gone."""
        queue: asyncio.Queue[bytes] = asyncio.Queue(_QUEUE)
        self.clients.add(queue)
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._watch())
        try:
            yield queue
        finally:
            self.clients.discard(queue)

    def end(self) -> None:
        """The last that was published, and no more messages: who is connected is let go of."""
        for queue in self.clients:
            _put(queue, *self._last_state, _OVER)

    async def _watch(self) -> None:
        try:
            await self._look_and_tell()
        finally:
            self.end()  # whoever is still there requests anew, and sees that nothing comes: no page may stand still

    async def _look_and_tell(self) -> None:
        tail = await run_in_threadpool(self._feed.tail)
        models: object = None
        believed: dict[str, tuple[float, float]] = {}
        drawn = believed
        looks, per_state, per_curve = 0, round(_STATE_S / _LOOK_S), round(_CURVE_S / _LOOK_S)
        while self.clients:
            with_state, with_curve = looks % per_state == 0, looks % per_curve == 0
            rows, state, now = await run_in_threadpool(self._looked, tail, with_state, with_curve)
            news: list[dict[str, Any]] = []
            if any(rows[key] for key in ("log", "estimates", "events")):
                news.append(rows)
                believed = believed | believed_of(rows["estimates"])
                speeds = [abs(speed) for speed in rows["log"].get("speed_rad_s", ()) if speed is not None]
                self.top_rad_s = max(self.top_rad_s, 1.1 * max(speeds, default=0.0))
            if state is not None:
                news.append(state)
                self._last_state = [_event(state)]
            if with_curve:
                if now != models:
                    news.append({"kind": "models"})
                    models = now
                elif believed != drawn:  # the model's file is up to a minute old
                    drawn = believed
                    if (curve := await run_in_threadpool(self._feed.curve, self.top_rad_s, believed)) is not None:
                        news.append(curve)
            self._tell(*news)
            looks += 1
            await asyncio.sleep(_LOOK_S)

    def _looked(self, tail: RunTail, with_state: bool, with_times: bool) -> tuple[dict[str, Any], Any, Any]:
        """New rows, and what else is due: in one go, for a thread that is woken costs more than what it does here."""
        feed = self._feed
        return tail.look(), feed.state() if with_state else None, feed.model_times() if with_times else None

    def _tell(self, *messages: dict[str, Any]) -> None:
        """Of one look: sent as one, so that each client is woken once; after long silence, that there is nothing."""
        self._silent_looks += 1
        if not messages and self._silent_looks * _LOOK_S < _STILL_HERE_S:
            return
        self._silent_looks = 0
        data = b"".join(map(_event, messages)) or b": still here\n\n"
        for queue in self.clients:
            if queue.full():
                _put(queue, _event({"kind": "behind"}))
            else:
                queue.put_nowait(data)


def _put(queue: asyncio.Queue[bytes], *messages: bytes) -> None:
    """In place of all that waits there."""
    while not queue.empty():
        queue.get_nowait()
    for message in messages:
        queue.put_nowait(message)


class _Answers:
    """What each address of the page answers."""

    def __init__(self, place: Place, access: Access) -> None:
        self._place, self._access = place, access
        self._files = {
            name: (STATIC / name).read_bytes() for name in ("page.html", *_FILES)
        }  # 90 kB: requested at once

    async def page(self, request: Request) -> Response:
        """The page itself."""
        return Response(self._files["page.html"], media_type="text/html")

    async def static(self, request: Request) -> Response:
        """A file of the page."""
        name = request.path_params["name"]
        return Response(self._files[name], media_type=_FILES[name]) if name in _FILES else _refusal(404, "no such file")

    async def runs(self, request: Request) -> Response:
        """Names of all runs, the newest first."""
        names = await run_in_threadpool(lambda: [RunFeed(path).name for path in self._place.runs()])
        return JSONResponse({"runs": names, "stop": self._place.stop is not None, "wheels": self._place.wheels})

    async def history(self, request: Request) -> Response:
        """A run's rows so far, thinned, with its state."""
        wanted = request.query_params
        try:
            span = (float(wanted.get("from", "-inf")), float(wanted.get("to", "inf")))
            points = min(int(wanted.get("points", POINTS)), _MOST_POINTS)
        except ValueError:
            return _refusal(400, "from, to and points are numbers")
        feed = await run_in_threadpool(self._place.feed, wanted.get("run", ""))
        document = await run_in_threadpool(feed.history, span, points)
        state = await run_in_threadpool(feed.state)
        return _json({**document, "state": state})

    async def curve(self, request: Request) -> Response:
        """The friction that was learned."""
        feed = await run_in_threadpool(self._place.feed, request.query_params.get("run", ""))
        try:
            top = float(request.query_params.get("top", "100"))
            if not math.isfinite(top):
                raise ValueError
            top = min(max(top, 1.0), 1.0e5)
            believed = _believed(json.loads(request.query_params.get("believed", "{}")))
        except (ValueError, TypeError, AttributeError, RecursionError):
            return _refusal(400, "top is a number, believed an object of [value, sigma]")
        if feed.name in self._place.watchers:
            self._place.watchers[feed.name].top_rad_s = top
        found = await run_in_threadpool(lambda: feed.curve(top, believed) or {"kind": "curve"})
        return _json(found)

    async def live(self, request: Request) -> Response:
        """What comes new, as server-sent events."""
        if sum(len(watcher.clients) for watcher in self._place.watchers.values()) >= _MOST_CLIENTS:
            return _refusal(503, f"{_MOST_CLIENTS} pages are open already")
        feed = await run_in_threadpool(self._place.feed, request.query_params.get("run", ""))
        watcher = self._place.watchers.setdefault(feed.name, Watcher(feed))
        return StreamingResponse(_messages(watcher), media_type="text/event-stream")

    async def stop(self, request: Request) -> Response:
        """Stop the run, for whoever has the token."""
        if self._place.stop is None:
            return _refusal(404, "this page was opened without a configuration: rw-ekf stop --config F")
        if not self._access.has_token(request):
            return _refusal(403, "the address that was printed has the token that this takes")
        self._place.stopping += 1
        try:
            return _json(await asyncio.get_running_loop().run_in_executor(self._place.stopper, self._place.stop))
        finally:
            self._place.stopping -= 1

    async def report(self, request: Request) -> Response:
        """The state of a run's report; begin one, for whoever has the token."""
        feed = await run_in_threadpool(self._place.feed, request.query_params.get("run", ""))
        if request.method == "POST":
            if not self._access.has_token(request):
                return _refusal(403, "the address that was printed has the token that this takes")
            self._place.reports.begin(feed.log)
        return _json(self._place.reports.state(feed.log))

    async def report_file(self, request: Request) -> Response:
        """A report that was made."""
        path = self._place.reports.file(request.path_params["ticket"])
        return FileResponse(path, media_type="text/html") if path else _refusal(404, "this link is over: open the run")


async def _unknown(request: Request, error: Exception) -> Response:
    return _refusal(404, str(error))


def page_app(place: Place, access: Access) -> Starlette:
    """The application that a server of ASGI runs."""
    answers = _Answers(place, access)
    routes = [
        Route("/", answers.page),
        Route("/static/{name}", answers.static),
        Route("/api/runs", answers.runs),
        Route("/api/history", answers.history),
        Route("/api/curve", answers.curve),
        Route("/api/live", answers.live),
        Route("/api/stop", answers.stop, methods=["POST"]),
        Route("/api/report", answers.report, methods=["GET", "POST"]),
        Route("/report/{ticket}", answers.report_file),
    ]
    return Starlette(
        routes=routes, middleware=[Middleware(_Guard, access=access)], exception_handlers={BadInputError: _unknown}
    )


async def _messages(watcher: Watcher) -> AsyncIterator[bytes]:
    async with watcher.client() as queue:
        message = b": hello\n\n"
        while message != _OVER:
            yield message
            message = await queue.get()


class _Guard:
    """Refuses requests by another name or without the token, and sets the headers of every answer."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app, self._access = app, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope)
        if not self._access.allows_host(request.headers.get("host", "")):
            text = "the page is asked by an address of this machine, or by the name that --listen NAME:PORT gave it"
            await _refusal(421, text)(scope, receive, send)
            return
        if self._access.wanted_always and scope["path"].startswith("/api/") and not self._access.has_token(request):
            await _refusal(403, "the address that was printed has the token that this takes")(scope, receive, send)
            return

        async def sending(message: Any) -> None:
            if message["type"] == "http.response.start":
                headers = _HEADERS | (_OF_REPORT if scope["path"].startswith("/report/") else {})
                message["headers"] += [(key.encode(), value.encode()) for key, value in headers.items()]
            await send(message)

        await self._app(scope, receive, sending)


def _believed(stated: Any) -> Believed:
    """Numbers with their sigmas. Raises ValueError, TypeError or AttributeError for anything else."""
    found = {str(name): (float(value), float(std)) for name, (value, std) in stated.items()}
    if not all(math.isfinite(value) and 0.0 <= std < math.inf for value, std in found.values()):
        raise ValueError("not finite")
    return found


def _event(message: dict[str, Any]) -> bytes:
    return f"data: {json.dumps(message, allow_nan=False)}\n\n".encode()


def _json(document: dict[str, Any]) -> Response:
    return Response(json.dumps(document, allow_nan=False), media_type="application/json")


def _refusal(status: int, text: str) -> Response:
    return JSONResponse({"error": text}, status_code=status, headers=_HEADERS)


def _is_loopback(host: str) -> bool:
    return host == "localhost" or (_is_address(host) and ipaddress.ip_address(host).is_loopback)


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True
