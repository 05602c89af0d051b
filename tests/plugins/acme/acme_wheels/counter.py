"""A sink: how many samples a run had, in a file beside its log."""

from __future__ import annotations

from pathlib import Path

from rw_ekf.records import Tick
from rw_ekf.sinks.all_sinks import RunContext, SinkKind


class Counter:
    """Counts, and writes the count at the end."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._count = 0

    def write(self, tick: Tick) -> None:
        """Take one turn."""
        self._count += 1

    def close(self) -> None:
        """Write the count."""
        self._path.write_text(f"{self._count}\n", encoding="utf-8")


def _make(run: RunContext) -> tuple[Counter, None]:
    return Counter(run.files.log.with_suffix(".count")), None


KIND = SinkKind(_make)
