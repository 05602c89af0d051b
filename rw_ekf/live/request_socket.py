"""The Unix domain socket that a controller's torque request comes in by: one client, never waited for.

Everything is non-blocking and bounded by turn: connections taken, bytes read, lines looked at, one line sent. Only the
newest request of a turn counts. A client that requests nothing for `stale_s` gives way to the next one; one that does
request is not thrown out, because two controllers on one wheel are worse than one that must be ended first.
"""

from __future__ import annotations

import contextlib
import math
import os
import socket
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from rw_ekf.clock import Clock
from rw_ekf.errors import BadInputError
from rw_ekf.live.request_lines import MOST_LINES, FadingRequest, LineBuffer, line_of, newest_torque
from rw_ekf.logs.metadata import utc_text
from rw_ekf.records import Tick
from rw_ekf.units import rpm_from_rad_s

_MOST_PATH_BYTES = 107  # of a Unix domain socket, on Linux
_READS = 8  # a turn, of 64 KiB: more than a socket's buffer holds
_CHUNK_BYTES = 65_536
_ACCEPTS = 4  # a turn
_STATED_AT_MOST = 10  # events about clients: after so many they are only counted


class RequestTerms(NamedTuple):
    """What makes an acceleration of a torque, and for how long a request holds."""

    inertia_kg_m2: float
    stale_s: float
    fade_s: float


class RequestSocket:
    """Takes requests, answers once a turn (as a sink of the loop). The file is there from the start to `close`."""

    def __init__(self, path: Path, terms: RequestTerms, clock: Clock, note: Callable[..., None]) -> None:
        """Raises BadInputError where there can be no socket at `path`, or another process listens there."""
        self._path = path
        self._terms = terms
        self.most_Nm = math.inf  # what the largest current gives, as soon as it is known: more is taken as this
        self._clock = clock
        self._note = note
        self._request = FadingRequest(terms.stale_s, terms.fade_s)
        self._client: socket.socket | None = None
        self._buffer = LineBuffer()
        self._unsent = b""
        self._wanted = False  # for a request in this turn
        self._taken_Nm = 0.0
        self._error: str | None = None
        self._stated = 0
        self.counts = dict.fromkeys(("clients", "refused_clients", "requests", "refused_lines", "unread_answers"), 0)
        self._listener = _listening(path)
        self._inode = os.stat(path).st_ino

    def request_rad_s2(self, tick: Tick) -> float:
        """The wheel's acceleration [rad/s^2] that is requested at this turn."""
        self._look()
        self._wanted = True
        self._taken_Nm = self._request.at(self._clock.monotonic())
        return self._taken_Nm / self._terms.inertia_kg_m2

    def write(self, tick: Tick) -> None:
        """Tell the client of a turn."""
        if not self._wanted:  # in this turn: the line is down, or the wheel is moved to confirm its sign
            self._look()
            self._taken_Nm = 0.0
        self._wanted = False
        if self._client is not None:
            self._answer(line_of(self._document(tick)))
            self._error = None

    def close(self) -> None:
        """Let go of the client, and remove the file if it is still ours."""
        self._drop("the run is over")
        self._listener.close()
        with contextlib.suppress(OSError):
            if os.stat(self._path).st_ino == self._inode:
                self._path.unlink()

    def _document(self, tick: Tick) -> dict[str, Any]:
        sample, compensation = tick.sample, tick.compensation
        reading = sample.speed_rad_s if tick.fresh else None
        return {
            "time_s": sample.time_s,
            "utc": utc_text(self._clock.utc()),
            "state": None if tick.state is None else tick.state.state.value,
            "speed_rpm": rpm_from_rad_s(tick.estimate.state.speed_rad_s),
            "reading_rpm": None if reading is None else rpm_from_rad_s(reading),
            "torque_Nm": self._taken_Nm,
            "age_s": self._request.age_s(self._clock.monotonic()),
            "current_A": None if tick.command is None else tick.command.current_A,
            "compensating": compensation is not None and compensation.on,
            "compensation_A": 0.0 if compensation is None else compensation.current_A,
            "parameters": None if compensation is None else str(compensation.parameters),
            "error": self._error,
        }

    def _look(self) -> None:
        """Take who has come, and the newest request."""
        self._read()
        for _ in range(_ACCEPTS):
            try:
                client, _ = self._listener.accept()
            except OSError:  # nobody, or one that has gone again
                return
            self._welcome(client)
            self._read()

    def _welcome(self, client: socket.socket) -> None:
        client.setblocking(False)
        if self._client is not None and self._request.is_fresh(self._clock.monotonic()):
            self.counts["refused_clients"] += 1
            self._say("request_client_refused", text="another controller asks for torques: end that one first")
            with contextlib.suppress(OSError):
                client.send(line_of({"error": "another controller asks for torques: this connection is closed"}))
            _close(client)
            return
        self._drop("another one came, and this one had not asked for anything of late")
        self.counts["clients"] += 1
        self._client, self._buffer, self._unsent, self._error = client, LineBuffer(), b"", None
        self._say("request_client", text="a controller is connected")

    def _read(self) -> None:
        """Take the newest request of what the client has sent; what it sent before it went counts."""
        lines: list[bytes] = []
        gone: str | None = None
        for _ in range(_READS):
            if self._client is None or gone is not None:
                break
            try:
                chunk = self._client.recv(_CHUNK_BYTES)
            except (BlockingIOError, InterruptedError):
                break
            except OSError as error:
                gone = str(error)
                break
            lines += self._buffer.take(chunk)
            gone = None if chunk else "it closed the connection"
        self._take(lines[-MOST_LINES:])
        if gone is not None:
            self._drop(gone)

    def _take(self, lines: list[bytes]) -> None:
        torque_Nm, wrong = newest_torque(lines)
        if wrong:
            self.counts["refused_lines"] += len(wrong)
            self._error = wrong[0]
            self._say("request_refused", text=wrong[0])
        if torque_Nm is not None:
            self.counts["requests"] += 1
            self._request.take(max(-self.most_Nm, min(self.most_Nm, torque_Nm)), self._clock.monotonic())

    def _answer(self, line: bytes) -> None:
        """Send a line, or what is left of the one before; a client that does not read misses lines, not parts."""
        assert self._client is not None
        waiting = self._unsent or line
        try:
            sent = self._client.send(waiting)
        except (BlockingIOError, InterruptedError):
            sent = 0
        except OSError as error:
            self._drop(str(error))
            return
        if self._unsent or sent == 0:
            self.counts["unread_answers"] += 1
        if sent > 0:
            self._unsent = waiting[sent:]

    def _drop(self, why: str) -> None:
        if self._client is not None:
            _close(self._client)
            self._client = None
            self._say("request_client_gone", text=f"the controller is gone ({why}): its last request fades to zero")

    def _say(self, event: str, text: str) -> None:
        self._stated += 1
        if self._stated <= _STATED_AT_MOST:
            self._note(
                event, text=text if self._stated < _STATED_AT_MOST else f"{text}; further such events are not said"
            )


def _close(client: socket.socket) -> None:
    """Close a connection so that the other end can read to its end: what is left unread here makes it a reset."""
    with contextlib.suppress(OSError):
        for _ in range(_READS):
            if not client.recv(_CHUNK_BYTES):
                break
    client.close()


def _listening(path: Path) -> socket.socket:
    """A listening socket at `path`, for its owner alone; the file of a process that has died is taken over."""
    if len(os.fsencode(path)) > _MOST_PATH_BYTES:
        raise BadInputError(
            f"compensation.socket {path}: a socket's path has {_MOST_PATH_BYTES} bytes at most: name a shorter one"
        )
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC | socket.SOCK_NONBLOCK)
    try:
        _make_way(path)
        os.fchmod(listener.fileno(), 0o600)  # the file gets this mode at once, not a moment after it is there
        listener.bind(os.fspath(path))
        listener.listen(_ACCEPTS)
    except OSError as error:
        listener.close()
        raise BadInputError(
            f"compensation.socket {path}: cannot be made ({error.strerror}): name another place"
        ) from None
    except BadInputError:
        listener.close()
        raise
    return listener


def _make_way(path: Path) -> None:
    """Remove a socket that nobody listens to; raises BadInputError for any other thing at its place."""
    try:
        there = os.lstat(path)
    except FileNotFoundError:
        return
    if not stat.S_ISSOCK(there.st_mode):
        raise BadInputError(f"compensation.socket {path}: something else is there: name another place, or remove it")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK) as probe:
        try:
            probe.connect(os.fspath(path))
        except ConnectionRefusedError:
            path.unlink()
            return
        except BlockingIOError:
            pass  # somebody listens, and has much to do
    raise BadInputError(f"compensation.socket {path}: another process listens there: end it, or name another place")
