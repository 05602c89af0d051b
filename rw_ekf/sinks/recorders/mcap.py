"""A run as MCAP, for Foxglove and whatever reads MCAP: samples, estimates with sigmas, and events."""

from __future__ import annotations

import contextlib
from datetime import datetime
from typing import Any

from rw_ekf.errors import BadInputError
from rw_ekf.logs.mcap_file import GrowingMcap
from rw_ekf.logs.metadata import metadata_path
from rw_ekf.logs.parts import beside
from rw_ekf.records import Tick
from rw_ekf.sinks.all_sinks import RunContext
from rw_ekf.sinks.log import PartSize
from rw_ekf.sinks.packer import Packer
from rw_ekf.sinks.recorders.tick_record import SAMPLE_FIELDS, Field, TickRecord, TickRecords, estimate_fields
from rw_ekf.version import __version__

NEEDS = ("mcap.writer", "zstandard")
SAMPLE, ESTIMATE, EVENT = "/wheel/sample", "/wheel/estimate", "/wheel/event"
_CHUNKED_WITHIN_S = 30.0  # 256 MB take 12 s
_TRY_EVERY_NS = 10_000_000_000  # to begin a part that could not be begun
_INFO, _WARNING = 2, 3  # foxglove.Log


class McapRecorder:
    """Appends each tick; the file continues in parts as the log does, and gets its index when it grows no more."""

    leaves_file = True

    def __init__(self, run: RunContext) -> None:
        """Begin the first part. Raises BadInputError if it cannot be made."""
        self._run = run
        self._records = TickRecords(run.clock, run.began, run.state_names)
        self._size = PartSize(3600.0 * run.output.part_hours, 1e6 * run.output.part_megabytes)
        self._packer = Packer(run.logger.warning, _CHUNKED_WITHIN_S)
        self._number = 1
        self._file = self._opened(1)
        self._began_ns = self._try_at_ns = 0  # of the part: its first tick
        self._rows = 0
        self._closed = False
        self._file.add([(EVENT, _reported(self._records.first))], self._records.now_ns())

    def write(self, tick: Tick) -> None:
        """Append what a tick brought. Raises OSError."""
        record = self._records.of(tick)
        self._in_part(record)
        messages = [(EVENT, _reported(event)) for event in record.events]
        if record.sample is not None and record.estimate is not None:
            messages = [(SAMPLE, record.sample), (ESTIMATE, record.estimate), *messages]
            self._rows += 1
        if messages:
            try:
                self._file.add(messages, record.stamp_ns)
            except OSError:
                self._records.lost(1)
                raise
        self._packer.look()

    def lost(self, ticks: int) -> None:
        """What was commanded meanwhile is not known."""
        self._records.lost(ticks)

    def close(self) -> None:
        """End the file, and give it its index. Where there never was a sample none is left behind."""
        if self._closed:
            return
        self._closed = True
        record = self._records.end()
        with contextlib.suppress(OSError):
            self._file.add([(EVENT, _reported(record.events[0]))], record.stamp_ns)
        self._close_part()
        if not self._rows:
            self._file.path.unlink(missing_ok=True)
        self._packer.close()

    def _opened(self, number: int) -> GrowingMcap:
        path = beside(self._run.files.log, "mcap" if number == 1 else f"part{number:03d}.mcap")
        schemas = {
            SAMPLE: ("rw_ekf.Sample", _schema("a row of the log", SAMPLE_FIELDS)),
            ESTIMATE: ("rw_ekf.Estimate", _schema("what the filter says", estimate_fields(self._run.state_names))),
            EVENT: ("foxglove.Log", _LOG),
        }
        about = {"version": __version__, "wheel": self._run.wheel, "port": self._run.port, "part": str(number)}
        return GrowingMcap(path, schemas, about | {"log": self._run.files.log.name})

    def _in_part(self, record: TickRecord) -> None:
        """Begin the next part where this one is full or was removed; metadata and first model with its first sample."""
        if record.sample is None:
            return
        first = self._began_ns == 0
        full = not first and (record.stamp_ns - self._began_ns) * 1e-9 >= self._size.seconds
        if self._file.removed or full or self._file.length >= self._size.bytes:
            first = self._next_part(record.stamp_ns) or first
        if first:
            self._began_ns = record.stamp_ns
            for file in (metadata_path(self._run.files.log), self._run.files.start):
                with contextlib.suppress(OSError):  # it says itself where it could not be written
                    self._file.attach(file, record.stamp_ns)

    def _next_part(self, stamp_ns: int) -> bool:
        if stamp_ns < self._try_at_ns:
            return False
        try:
            file = self._opened(self._number + 1)
        except BadInputError as error:
            self._try_at_ns = stamp_ns + _TRY_EVERY_NS
            self._run.logger.warning("part_not_begun", reason=str(error), do="the file goes on in the part there is")
            return False
        self._close_part()
        self._file, self._number = file, self._number + 1
        return True

    def _close_part(self) -> None:
        removed = self._file.removed
        with contextlib.suppress(OSError):
            self._file.close()
        if self._rows and not removed:
            self._packer.pack([self._file.path])


recorder_of = McapRecorder


def _schema(meaning: str, fields: Any) -> dict[str, Any]:
    return {
        "type": "object",
        "description": meaning,
        "properties": {name: _property(field) for name, field in fields.items()},
    }


def _property(field: Field) -> dict[str, Any]:
    unit = f" [{field.unit}]" if field.unit else ""
    return {"type": [field.kind, "null"], "description": field.meaning + unit}


_TIME = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
_LOG = {  # https://docs.foxglove.dev/docs/sdk/schemas/log, and the event as it stands in STEM.events.jsonl
    "title": "foxglove.Log",
    "type": "object",
    "properties": {
        "timestamp": _TIME,
        "level": {"type": "integer"},
        "message": {"type": "string"},
        "name": {"type": "string"},
        "file": {"type": "string"},
        "line": {"type": "integer"},
        "event": {"type": "object"},
    },
}


def _reported(event: dict[str, Any]) -> dict[str, Any]:
    """An event as a line of a log."""
    moment = datetime.fromisoformat(event["utc"])
    words = [event.get(key) for key in ("state", "name", "scheme", "text", "reason")]
    wrong = event["event"] == "alarm" or event.get("state") in ("DEGRADED", "LOST", "SAFE")
    return {
        "timestamp": {"sec": int(moment.timestamp()), "nsec": moment.microsecond * 1000},
        "level": _WARNING if wrong else _INFO,
        "message": ": ".join(word for word in words if word),
        "name": event["event"],
        "file": "",
        "line": 0,
        "event": event,
    }
