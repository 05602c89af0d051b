"""The two files of a run that grow: every sample, and every estimate, a line each as it comes."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from pathlib import Path

from rw_ekf.clock import Clock
from rw_ekf.logs.writer import EstimateWriter, SampleWriter
from rw_ekf.records import Outcome, Tick
from rw_ekf.sinks.run_files import Note, Unwritten

_SYNC_EVERY_S = 10.0  # so that a power cut loses little


class LogSink:
    """Appends every tick to both files; on disk at least every ten seconds.

    A wheel is not let go of because a disk is full or its directory gone: what cannot be written is counted, said once,
    and tried again with the next sample. After rows that are missing a new segment begins in the log, because nobody
    who reads it can know what current was in force between.
    """

    def __init__(
        self, samples: SampleWriter, estimates: EstimateWriter, clock: Clock, unwritten: Unwritten, note: Note
    ) -> None:
        """unwritten: where the losses are counted; note: told of the first one."""
        self._samples = samples
        self._estimates = estimates
        self._clock = clock
        self._unwritten = unwritten
        self._note = note
        self._breaks = 0
        self._broken = False
        self._sync_due_s = clock.monotonic() + _SYNC_EVERY_S

    def write(self, tick: Tick) -> None:
        """Append one line to each file."""
        sample, estimate = tick.sample, tick.estimate
        if estimate.outcome in (Outcome.REPEATED, Outcome.BACKWARD):
            return  # a log's time only grows; the statistics count these
        breaks = self._breaks + self._broken
        try:
            self._samples.write(replace(sample, segment=sample.segment + breaks) if breaks else sample, tick.command)
            self._breaks, self._broken = breaks, False
        except OSError as error:
            self._broken = True
            self._unwritten.log_rows += 1
            self._say(self._samples.path, error.strerror or str(error))
        try:
            self._estimates.write(estimate)
        except OSError as error:
            self._unwritten.estimate_rows += 1
            self._say(self._estimates.path, error.strerror or str(error))
        if self._clock.monotonic() >= self._sync_due_s:
            self._sync_due_s = self._clock.monotonic() + _SYNC_EVERY_S
            self._sync()

    def lost(self, ticks: int) -> None:
        """Count ticks that never came here: the disk was too slow for them."""
        self._broken = True
        self._unwritten.log_rows += ticks
        self._unwritten.estimate_rows += ticks
        self._say(self._samples.path, "the disk is too slow")

    def close(self) -> None:
        """Close both files; what a full disk did not take has been counted by the write that failed."""
        self._sync()
        for writer in (self._samples, self._estimates):
            with contextlib.suppress(OSError):
                writer.close()

    def _sync(self) -> None:
        for writer in (self._samples, self._estimates):
            with contextlib.suppress(OSError):
                writer.sync()

    def _say(self, path: Path, reason: str) -> None:
        if self._unwritten.note(f"{path}: {reason}"):
            self._note(
                "not_written",
                file=str(path),
                reason=reason,
                do="the run goes on and counts what is missing from its log: make room; a directory that was removed "
                "does not come back during this run",
            )
