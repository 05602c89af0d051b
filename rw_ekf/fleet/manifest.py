"""What was done, a line of JSON for each log: appended as it is done, written anew in order when a run ends.

It is an account, not the truth: done is what has its file among the results. A line that a kill cut short is left out,
and a result that no line speaks of is taken up from its own file.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from rw_ekf.fleet.plan import PlannedLog
from rw_ekf.fleet.task import Record
from rw_ekf.logs.atomic import write_text
from rw_ekf.plain_file import json_of
from rw_ekf.version import __version__


@dataclass(frozen=True)
class ManifestLine:
    """One log of the fleet."""

    input_hash: str
    model_hash: str
    version: str
    wheel: str
    day: str
    log: str
    rows: int
    seconds: float | None  # that a worker took; None: a result that an interrupted run left
    status: str  # `ok`, `failed: ` and why, or `not done: ` and why, which another run tries again

    @classmethod
    def of(cls, planned: PlannedLog, record: Record | None, status: str, rows: int = 0) -> ManifestLine:
        """Of a log that a worker has spoken of, or has not."""
        log = planned.log
        spoken = (record.rows, record.seconds, record.status) if record is not None else (rows, None, status)
        return cls(planned.input_hash, planned.model_hash, __version__, log.wheel, log.day, log.log, *spoken)

    def to_line(self) -> bytes:
        """As it is written."""
        return json.dumps(asdict(self)).encode() + b"\n"


def read_manifest(path: Path) -> dict[str, ManifestLine]:
    """The lines by input hash, the last one of each; lines that are none are left out."""
    try:
        text = path.read_bytes()
    except OSError:
        return {}
    found = {}
    for line in text.splitlines():
        data = json_of(line)
        try:
            entry = ManifestLine(**data)
        except TypeError:
            continue
        found[entry.input_hash] = entry
    return found


def write_manifest(path: Path, entries: Iterable[ManifestLine]) -> None:
    """Write it anew, all or nothing, in the order given. Raises BadInputError."""
    write_text(path, b"".join(entry.to_line() for entry in entries).decode(), follow=False)
