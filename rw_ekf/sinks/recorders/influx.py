"""A run as InfluxDB takes it: line protocol, into a file beside the log, over UDP, or to a server's write address."""

from __future__ import annotations

import contextlib
import itertools
import os
import re
import urllib.error
import urllib.request
from collections import deque
from collections.abc import Callable, Mapping
from http.client import HTTPException
from typing import Any, Protocol

from rw_ekf.clock import Clock
from rw_ekf.errors import BadInputError
from rw_ekf.logs.parts import beside
from rw_ekf.plain_file import append_line
from rw_ekf.records import Tick
from rw_ekf.sinks.all_sinks import RunContext
from rw_ekf.sinks.recorders.datagrams import Datagrams
from rw_ekf.sinks.recorders.tick_record import TickRecord, TickRecords
from rw_ekf.sinks.run_files import Note

NEEDS = ()
TOKEN = "INFLUX_TOKEN"  # a secret is no part of a configuration, which every run copies into its metadata
_DATAGRAM = 1400  # bytes, so that none is taken apart on its way
_MOST_WAITING = 3000  # ticks for a server that does not answer: five minutes at 10 Hz
_SEND_EVERY_S = 1.0
_TRY_EVERY_S = 5.0
_ANSWER_WITHIN_S = 3.0
_NEVER_TAKEN, _TOO_LARGE = (400, 422), 413  # of the rows, by the API: the same again is refused again, or half of it
_SHOWN_BYTES = 300
_TEXT = str.maketrans({'"': r"\"", "\\": r"\\", "\n": " ", "\r": " "})


class _Target(Protocol):
    def put(self, lines: list[bytes]) -> None:
        """Take the lines of a tick. Raises OSError."""
        ...

    def close(self) -> None:
        """Let what waits go."""
        ...


class InfluxRecorder:
    """Two points for each sample, one for each event; tags: the wheel and the run."""

    def __init__(self, run: RunContext, target: _Target, *, leaves_file: bool) -> None:
        self.leaves_file = leaves_file
        self._records = TickRecords(run.clock, run.began, run.state_names)
        self._target = target
        self._tags = {"wheel": run.wheel, "run": run.files.log.stem}
        self._open = False  # from the first sample on, to the end

    def write(self, tick: Tick) -> None:
        """Hand the points of a turn over. Raises OSError where a file cannot be written."""
        lines = self._lines(self._records.of(tick))
        if not lines:
            return
        self._open = True
        try:
            self._target.put(lines)
        except OSError:
            self._records.lost(1)
            raise

    def lost(self, ticks: int) -> None:
        """What was commanded meanwhile is not known."""
        self._records.lost(ticks)

    def close(self) -> None:
        """Say that the run has ended, and finish."""
        if self._open:
            self._open = False
            with contextlib.suppress(OSError):
                self._target.put(self._lines(self._records.end()))
        self._target.close()

    def _lines(self, record: TickRecord) -> list[bytes]:
        named: list[tuple[str, dict[str, str], dict[str, Any] | None]] = [
            ("rw_ekf_sample", {}, record.sample),
            ("rw_ekf_estimate", {}, record.estimate),
        ]
        for event in record.events:
            fields = {key: value for key, value in event.items() if key not in ("event", "utc")}
            named.append(("rw_ekf_event", {"event": str(event["event"])}, fields))
        points = [
            point(name, {**self._tags, **tags}, fields, record.stamp_ns) for name, tags, fields in named if fields
        ]
        return [line for line in points if line is not None]


class _File:
    """A file beside the log, to which a tick's lines are added in one."""

    def __init__(self, run: RunContext) -> None:
        self._path = beside(run.files.log, "lp")
        if os.path.lexists(self._path):
            raise BadInputError(f"{self._path}: exists already and is not overwritten: move it away")

    def put(self, lines: list[bytes]) -> None:
        append_line(self._path, b"".join(lines))

    def close(self) -> None:
        pass


class _Udp:
    """Datagrams of whole lines."""

    def __init__(self, datagrams: Datagrams) -> None:
        self._datagrams = datagrams

    def put(self, lines: list[bytes]) -> None:
        packed = [b""]
        for line in lines:
            if packed[-1] and len(packed[-1]) + len(line) > _DATAGRAM:
                packed.append(b"")
            packed[-1] += line
        self._datagrams.send(*packed)

    def close(self) -> None:
        self._datagrams.close()


class _Http:
    """Batches, once a second; while nobody answers the newest wait, and what is older is counted."""

    def __init__(self, address: str, clock: Clock, missed: Callable[[int, str], None], say: Note) -> None:
        self._address = address
        self._clock = clock
        self._missed = missed
        self._say = say
        self._waiting: deque[list[bytes]] = deque()
        self._due_s = clock.monotonic() + _SEND_EVERY_S
        self._most = _MOST_WAITING  # ticks of a batch
        self._event: str | None = None  # what was reported of the outage
        self._reason: str | None = None  # why the last batch was not taken

    def put(self, lines: list[bytes]) -> None:
        self._waiting.append(lines)
        if len(self._waiting) > _MOST_WAITING:
            self._waiting.popleft()
            self._missed(1, self._reason or "the server does not keep up")
        if self._clock.monotonic() >= self._due_s:
            self._send()

    def close(self) -> None:
        before = -1
        while self._waiting and len(self._waiting) != before:
            before = len(self._waiting)
            self._send()
        if self._waiting:
            self._missed(len(self._waiting), self._reason or "")
            self._waiting.clear()

    def _send(self) -> None:
        batch = list(itertools.islice(self._waiting, self._most))
        headers = {"Content-Type": "text/plain; charset=utf-8"}
        if token := os.environ.get(TOKEN):
            headers["Authorization"] = f"Token {token}"
        request = urllib.request.Request(self._address, b"".join(line for lines in batch for line in lines), headers)
        try:
            urllib.request.urlopen(request, timeout=_ANSWER_WITHIN_S).close()
        except urllib.error.HTTPError as error:
            self._refused(error, len(batch))
            return
        except (OSError, ValueError, HTTPException) as error:
            self._wait("influx_not_reached", str(error), "the newest five minutes wait")
            return
        self._event = self._reason = None
        self._forget(len(batch))
        self._due_s = self._clock.monotonic() + _SEND_EVERY_S

    def _refused(self, error: urllib.error.HTTPError, ticks: int) -> None:
        """The server is there: rows that it will never take are given up, all others are sent again."""
        stated = ""
        with contextlib.suppress(OSError, HTTPException), error:
            stated = " ".join(error.read(_SHOWN_BYTES).decode("utf-8", "replace").split())
        reason = f"{error}: {stated}" if stated else str(error)
        if error.code in (401, 403):
            self._wait("influx_refused", reason, f"give a token that may write there in {TOKEN}; the newest rows wait")
        elif error.code == _TOO_LARGE and ticks > 1:
            self._most = ticks // 2
            self._due_s = self._clock.monotonic() + _SEND_EVERY_S
        elif error.code in (*_NEVER_TAKEN, _TOO_LARGE):
            self._missed(ticks, reason)
            self._forget(ticks)
            self._wait("influx_refused", reason, "these rows are given up, and counted")
        else:
            self._wait("influx_not_reached", reason, "the newest five minutes wait")

    def _forget(self, ticks: int) -> None:
        """The first of those that wait: they were taken, or never will be."""
        for _ in range(ticks):
            self._waiting.popleft()

    def _wait(self, event: str, reason: str, do: str) -> None:
        """Until the next try. It is reported with the first of an outage, and where it becomes another."""
        if self._event != event:
            self._say(event, reason=reason, do=do)
        self._event, self._reason = event, reason
        self._due_s = self._clock.monotonic() + _TRY_EVERY_S


def recorder_of(run: RunContext) -> InfluxRecorder:
    """The recorder of a run. Raises BadInputError for a place that cannot be had."""
    target = str(run.output.influx)
    if target == "file":
        return InfluxRecorder(run, _File(run), leaves_file=True)

    def missed(ticks: int, reason: str) -> None:
        run.unwritten.miss("influx", ticks, reason, run.logger.error)

    if not target.startswith("udp://"):
        return InfluxRecorder(run, _Http(target, run.clock, missed, run.logger.warning), leaves_file=False)
    try:
        datagrams = Datagrams("influx", target.removeprefix("udp://"), missed, run.logger.warning)
        return InfluxRecorder(run, _Udp(datagrams), leaves_file=False)
    except OSError as error:
        raise BadInputError(f"output.influx: {target} is no place on a network ({error}): mend it") from None


def point(name: str, tags: Mapping[str, str], fields: Mapping[str, Any], stamp_ns: int) -> bytes | None:
    r"""One line of the protocol, name,tag=value field=value,field=value STAMP, with its end; None for no known field.

    https://docs.influxdata.com/influxdb/v2/reference/syntax/line-protocol/: commas and blanks, in tags and keys of
    fields also equal signs, have a stroke before them; in a text that is a field's value, quotes and strokes.
    fields: numbers, truths, texts, or None.
    """
    known = [f"{_key(key)}={_value(value)}" for key, value in fields.items() if value is not None]
    if not known:
        return None
    reported = "".join(f",{_key(key)}={_key(value)}" for key, value in tags.items())
    return f"{_key(name)}{reported} {','.join(known)} {stamp_ns}\n".encode()


def _key(text: str) -> str:
    """A name, a key or a tag's value: no line of its own, no stroke at its end, which nothing could escape."""
    plain = re.sub(r"\s", " ", text).rstrip("\\") or "_"
    return re.sub(r"([,= ])", r"\\\1", plain)


def _value(value: float | str | bool) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return f"{value}i"
    return repr(value) if isinstance(value, float) else f'"{value.translate(_TEXT)}"'
