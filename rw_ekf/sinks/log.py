"""The two files of a run that grow: every sample, and every estimate, a line each as it comes, in parts."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from rw_ekf.clock import Clock
from rw_ekf.errors import BadInputError
from rw_ekf.logs.record_print import RecordPrint
from rw_ekf.logs.writer import EstimateWriter, SampleWriter
from rw_ekf.records import Outcome, Tick, WheelSample
from rw_ekf.sinks.packer import Packer
from rw_ekf.sinks.run_files import Note, Unwritten

_SYNC_EVERY_S = 10.0  # so that a power cut loses little
_TRY_EVERY_S = 10.0  # to begin a part that could not be begun


class PartFiles(NamedTuple):
    """A part while it grows."""

    samples: SampleWriter
    estimates: EstimateWriter


class PartSize(NamedTuple):
    """When a part is full: after so much time of samples, or with so long a file."""

    seconds: float
    bytes: float


class LogSink:
    """Appends every tick to both files; on disk at least every ten seconds. Full parts are closed and compressed.

    A wheel is not let go of because a disk is full or its directory gone: what cannot be written is counted, noted once
    and tried again with the next sample, in a part of its own where the file has been removed. After rows that are
    missing a new segment begins in the log, because nobody who reads it can know what current was in force between.
    """

    def __init__(
        self,
        open_part: Callable[[int], PartFiles],
        size: PartSize,
        packer: Packer,
        clock: Clock,
        unwritten: Unwritten,
        note: Note,
        record: RecordPrint | None = None,
    ) -> None:
        """Begin the first part.

        open_part: makes the files of a part by its number, BadInputError where they cannot be made; unwritten: where
        the losses are counted; note: called for the first one; record: called for every row.
        """
        self._open_part = open_part
        self._size = size
        self._packer = packer
        self._clock = clock
        self._unwritten = unwritten
        self._stated = False
        self._note = note
        self._record = record if record is not None else RecordPrint()
        self._number = 1
        self._part = open_part(1)
        self._part_s = 0.0  # time of samples in the part
        self._try_at_s = 0.0  # to begin the next one, where that has failed
        self._try_stated = False
        self._last: WheelSample | None = None
        self._breaks = 0
        self._broken = False
        self._sync_due_s = clock.monotonic() + _SYNC_EVERY_S

    def write(self, tick: Tick) -> None:
        """Append one line to each file."""
        sample, estimate = tick.sample, tick.estimate
        if estimate.outcome in (Outcome.REPEATED, Outcome.BACKWARD):
            return  # a log's time only grows; the statistics count these
        self._in_part(tick)
        breaks = self._breaks + self._broken
        try:
            reported = replace(sample, segment=sample.segment + breaks) if breaks else sample
            self._part.samples.write(reported, tick.command)
            self._breaks, self._broken = breaks, False
            self._record.add(sample.time_s, sample.speed_rad_s)
        except OSError as error:
            self._broken = True
            self._unwritten.log_rows += 1
            self._say(self._part.samples.path, error.strerror or str(error))
        added_A = None if tick.compensation is None else tick.compensation.current_A
        self._estimated(lambda: self._part.estimates.write(estimate, added_A))
        if self._clock.monotonic() >= self._sync_due_s:
            self._sync_due_s = self._clock.monotonic() + _SYNC_EVERY_S
            self._sync()
            self._packer.look()

    def lost(self, ticks: int) -> None:
        """Count ticks that never came here: the disk was too slow for them."""
        self._broken = True
        self._unwritten.log_rows += ticks
        self._unwritten.estimate_rows += ticks
        self._say(self._part.samples.path, "the disk is too slow")

    def close(self) -> None:
        """Close both files; what a full disk did not take has been counted by the write that failed.

        Files in which there never was a row are not left behind.
        """
        self._close_part()
        if self._number == 1 and self._last is None and not self._unwritten.log_rows:
            for file in self._part:
                file.path.unlink(missing_ok=True)
        self._packer.close()

    def _in_part(self, tick: Tick) -> None:
        """Begin the next part where this one is full, or where one of its files has been removed.

        A part begins with a row that knows its current and its speed, so that it reads without those before it.
        """
        sample = tick.sample
        last, self._last = self._last, sample
        if last is not None and sample.segment == last.segment:
            self._part_s += max(sample.time_s - last.time_s, 0.0)
        full = self._part_s >= self._size.seconds or max(file.length for file in self._part) >= self._size.bytes
        removed = any(file.removed or file.cut for file in self._part)
        whole = tick.command is not None and sample.speed_rad_s is not None
        if removed or (full and whole and self._part_s >= self._try_at_s):
            self._next_part(removed=removed)

    def _next_part(self, *, removed: bool) -> None:
        try:
            part = self._open_part(self._number + 1)
        except BadInputError as error:  # this part takes what comes, however long it gets
            self._try_at_s = self._part_s + _TRY_EVERY_S
            if not removed and not self._try_stated:
                self._note("part_not_begun", reason=str(error), do="the log goes on in the part there is")
                self._try_stated = True
            return
        self._close_part()
        if not removed:
            self._packer.pack([file.path for file in self._part])
        self._unwritten.log_rows += self._part.samples.rows * self._part.samples.cut
        self._unwritten.estimate_rows += self._part.estimates.rows * self._part.estimates.cut
        self._part, self._number = part, self._number + 1
        self._part_s = self._try_at_s = 0.0

    def _estimated(self, write: Callable[[], None]) -> None:
        try:
            write()
        except OSError as error:
            self._unwritten.estimate_rows += 1
            self._say(self._part.estimates.path, error.strerror or str(error))

    def _close_part(self) -> None:
        self._estimated(self._part.estimates.finish)
        self._sync()
        for writer in self._part:
            with contextlib.suppress(OSError):
                writer.close()

    def _sync(self) -> None:
        for writer in self._part:
            with contextlib.suppress(OSError):
                writer.sync()

    def _say(self, path: Path, reason: str) -> None:
        self._unwritten.note(f"{path}: {reason}")
        if not self._stated:  # by this sink: another's trouble before it says nothing of the log
            self._stated = True
            self._note(
                "not_written",
                file=str(path),
                reason=reason,
                do="the run goes on and counts what is missing from its log: make room; where the directory was "
                "removed and is there again, the log goes on in a new part",
            )
