"""Where a run's samples and estimates go: log, estimates, state file, statistics, arrays."""

from __future__ import annotations

import contextlib
import json
import os
import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.errors import RwEkfError
from rw_ekf.model.state import STATE_NAMES
from rw_ekf.records import Clock, Outcome, Tick
from rw_ekf.statistics import RunStatistics

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rw_ekf.arrays import Float64Array
    from rw_ekf.filter.filter_run import FilterRun
    from rw_ekf.logs.writer import EstimateWriter, SampleWriter


Note = Callable[..., None]


@dataclass
class Unwritten:
    """What a run could not put on the disk: it went on without (the `unwritten` object of `run --json`)."""

    log_rows: int = 0
    estimate_rows: int = 0
    state_files: int = 0
    other_files: list[str] = field(default_factory=list)  # metadata or model
    reason: str | None = None  # of the first failure

    def __bool__(self) -> bool:
        """Whether anything that the run was to leave is missing; the state file only tells of the moment."""
        return self.log_rows + self.estimate_rows + len(self.other_files) > 0

    def note(self, reason: str) -> bool:
        """Keep the first reason; True if this is the first."""
        first = self.reason is None
        self.reason = self.reason or reason
        return first


class LogSink:
    """Every sample, and every estimate, a line each as it comes; on disk at least every ten seconds.

    A wheel is not let go of because a disk is full or its directory gone: what cannot be written is counted, said once,
    and tried again with the next sample. After rows that are missing a new segment begins in the log, because nobody
    who reads it can know what current was in force between.
    """

    def __init__(
        self,
        samples: SampleWriter,
        estimates: EstimateWriter,
        unwritten: Unwritten | None = None,
        note: Note | None = None,
    ) -> None:
        """unwritten: where the losses are counted; note: told of the first one."""
        self._samples = samples
        self._estimates = estimates
        self.unwritten = unwritten if unwritten is not None else Unwritten()
        self._note = note
        self._breaks = 0
        self._broken = False

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
            self.unwritten.log_rows += 1
            self._lost(self._samples.path, error)
        try:
            self._estimates.write(estimate)
        except OSError as error:
            self.unwritten.estimate_rows += 1
            self._lost(self._estimates.path, error)

    def close(self) -> None:
        """Close both files; what a full disk did not take has been counted by the write that failed."""
        for writer in (self._samples, self._estimates):
            with contextlib.suppress(OSError):
                writer.close()

    def _lost(self, path: Path, error: OSError) -> None:
        reason = error.strerror or str(error)
        if self.unwritten.note(f"{path}: {reason}") and self._note is not None:
            self._note(
                "not_written",
                file=str(path),
                reason=reason,
                do="the run goes on and counts what is missing from its log: make room; a directory that was removed "
                "does not come back during this run",
            )


class StatisticsSink:
    """Running statistics, flat in memory."""

    def __init__(self) -> None:
        self.statistics = RunStatistics()
        self._segment: int | None = None

    def write(self, tick: Tick) -> None:
        """Count one sample."""
        self.statistics.add(tick.estimate, same_segment=tick.sample.segment == self._segment)
        self._segment = tick.sample.segment

    def close(self) -> None:
        """Nothing to finish."""


class StateFileSink:
    """Publishes the latest estimate as one small JSON file, replaced whole, at most once a second of the host's clock.

    Writing, fsync and rename run in a thread of their own: a slow disk must not make a tick late.
    """

    def __init__(
        self,
        path: Path,
        about: dict[str, Any],
        clock: Clock,
        every_s: float = 1.0,
        unwritten: Unwritten | None = None,
        *,
        watched: bool = True,
    ) -> None:
        """watched: whether the document has alarms. unwritten: where what could not be published is counted."""
        self.path = path
        self._unwritten = unwritten if unwritten is not None else Unwritten()
        self._watched = watched
        self._about = about
        self._clock = clock
        self._every_s = every_s
        self._due_s = 0.0
        self._latest: dict[str, Any] | None = None
        self._is_due = False
        self._wake = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._serve, name="state-file", daemon=True)
        self._thread.start()

    def write(self, tick: Tick) -> None:
        """Hand the newest estimate over, if one is due."""
        estimate = tick.estimate
        document = {
            **self._about,
            "time_s": estimate.time_s,
            "outcome": estimate.outcome.value,
            "state": {**estimate.state._asdict(), **{name: c.value for name, c in estimate.effects.items()}},
            "std": {**estimate.std._asdict(), **{name: c.std for name, c in estimate.effects.items()}},
            "current_command_A": None if tick.command is None else tick.command.current_A,
            "temperature_degC": tick.sample.temperature_degC,
        }
        if self._watched:
            document["alarms"] = [alarm.document() for alarm in tick.alarms]
        now = self._clock.monotonic()
        with self._wake:
            self._latest = document
            if now >= self._due_s:
                self._due_s = now + self._every_s
                self._is_due = True
                self._wake.notify()

    def close(self) -> None:
        """Write the last estimate and end the thread."""
        with self._wake:
            self._closing = True
            self._wake.notify()
        self._thread.join(timeout=5.0)

    def _serve(self) -> None:
        from rw_ekf.logs.atomic import write_text

        while True:
            with self._wake:
                while not (self._is_due or self._closing):
                    self._wake.wait()
                document, self._latest, self._is_due = self._latest, None, False
                if document is None:
                    return
            try:
                write_text(self.path, json.dumps(document, indent=2, allow_nan=False) + "\n", follow=False)
            except (OSError, ValueError, RwEkfError):
                self._unwritten.state_files += 1  # it tells of the moment: the next one is tried, the log says why


class ArraySink:
    """Collects a replay through the loop into the arrays that the compiled pass would have filled."""

    def __init__(self, n: int, advance: Callable[[int], object] = lambda n: None, size: int = len(STATE_NAMES)) -> None:
        import numpy as np

        from rw_ekf.filter import decisions

        self._codes = {outcome: getattr(decisions, outcome.name) for outcome in Outcome}
        self._row = 0
        self._advance = advance
        self.outcome: NDArray[np.int8] = np.zeros(n, np.int8)
        self.innovation: Float64Array = np.full(n, np.nan)
        self.variance: Float64Array = np.full(n, np.nan)
        self.states: Float64Array = np.zeros((n, size))
        self.stds: Float64Array = np.zeros((n, size))

    def write(self, tick: Tick) -> None:
        """Take the next row."""
        i = self._row
        estimate = tick.estimate
        self.outcome[i] = self._codes[estimate.outcome]
        self.states[i] = estimate.values
        self.stds[i] = estimate.stds
        if estimate.innovation is not None:
            self.innovation[i] = estimate.innovation.innovation_rad_s
            self.variance[i] = estimate.innovation.std_rad_s**2
        self._row = i + 1
        if self._row % 100 == 0:
            self._advance(100)

    def close(self) -> None:
        """Nothing to finish."""

    def as_run(self, mean: Float64Array, covariance: Float64Array) -> FilterRun:
        """Return the run, given the estimator's final belief."""
        from rw_ekf.filter.filter_run import FilterRun, History

        none = History.zeros(0, len(mean))
        return FilterRun(mean, covariance, self.innovation, self.variance, self.outcome, self.states, self.stds, none)


class SyncSink:
    """Forces the files of a run onto the disk every few seconds, in a thread, so that a power cut loses little."""

    def __init__(self, paths: list[Path], every_s: float = 10.0) -> None:
        self._paths = paths
        self._stop = threading.Event()
        self._every_s = every_s
        self._thread = threading.Thread(target=self._serve, name="disk-sync", daemon=True)
        self._thread.start()

    def write(self, tick: Tick) -> None:
        """Nothing: the thread keeps its own time."""

    def close(self) -> None:
        """Sync once more and end."""
        self._stop.set()
        self._thread.join(timeout=5.0)

    def _serve(self) -> None:
        while True:
            ended = self._stop.wait(self._every_s)
            for path in self._paths:
                try:
                    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
                    try:
                        os.fsync(descriptor)
                    finally:
                        os.close(descriptor)
                except OSError:
                    continue
            if ended:
                return
