"""Where a run's samples and estimates go: log, estimates, state file, statistics, arrays, a person's terminal."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.errors import RwEkfError
from rw_ekf.model.state import STATE_NAMES
from rw_ekf.records import IssuedCommand, Outcome, StepResult, WheelSample
from rw_ekf.statistics import RunStatistics
from rw_ekf.units import rpm_from_rad_s

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rw_ekf.filter.log_filter import FilterRun
    from rw_ekf.logs.writer import EstimateWriter, SampleWriter


class LogSink:
    """Every sample, and every estimate, a line each as it comes; on disk at least every ten seconds."""

    def __init__(self, samples: SampleWriter, estimates: EstimateWriter) -> None:
        self._samples = samples
        self._estimates = estimates

    def write(self, sample: WheelSample, command: IssuedCommand | None, result: StepResult) -> None:
        """Append one line to each file."""
        if result.outcome in (Outcome.REPEATED, Outcome.BACKWARD):
            return  # a log's time only grows; the statistics count these
        try:
            self._samples.write(sample, command)
            self._estimates.write(result)
        except OSError as error:
            raise RwEkfError(
                f"{self._samples.path}: the log cannot be written on ({error.strerror}): make room, or give another "
                "output.directory. The run ends; what is logged so far can be replayed."
            ) from None

    def close(self) -> None:
        """Close both files; what a full disk did not take has been reported by the write that failed."""
        for writer in (self._samples, self._estimates):
            with contextlib.suppress(OSError):
                writer.close()


class StatisticsSink:
    """Running statistics, flat in memory."""

    def __init__(self) -> None:
        self.statistics = RunStatistics()
        self._segment: int | None = None

    def write(self, sample: WheelSample, command: IssuedCommand | None, result: StepResult) -> None:
        """Count one sample."""
        self.statistics.add(result, same_segment=sample.segment == self._segment)
        self._segment = sample.segment

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
        every_s: float = 1.0,
        names: tuple[str, ...] = STATE_NAMES,
        alarms: Callable[[], list[dict[str, Any]]] | None = None,
    ) -> None:
        """alarms: gives those that are on, as they are to be published; None: nobody watches."""
        self.path = path
        self._alarms = alarms
        self._names = names
        self._about = about
        self._every_s = every_s
        self._due_s = 0.0
        self._latest: dict[str, Any] | None = None
        self._is_due = False
        self._wake = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._serve, name="state-file", daemon=True)
        self._thread.start()

    def write(self, sample: WheelSample, command: IssuedCommand | None, result: StepResult) -> None:
        """Hand the newest estimate over, if one is due."""
        document = {
            **self._about,
            "time_s": result.time_s,
            "outcome": result.outcome.value,
            "state": dict(zip(self._names, result.mean, strict=True)),
            "std": dict(zip(self._names, result.std, strict=True)),
            "current_command_A": None if command is None else command.current_A,
            "temperature_degC": sample.temperature_degC,
        }
        if self._alarms is not None:
            document["alarms"] = [dict(alarm) for alarm in self._alarms()]
        now = time.monotonic()
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
                write_text(self.path, json.dumps(document, indent=2, allow_nan=False) + "\n")
            except (OSError, ValueError, RwEkfError):
                continue  # a full disk must not end the run; the log's own writer will say so


class TerminalSink:
    """One line on standard error that keeps changing, for a person who watches. Silent unless it is a terminal."""

    def __init__(self, every_s: float = 0.5) -> None:
        self._shown = sys.stderr.isatty()
        self._every_s = every_s
        self._due_s = 0.0

    def write(self, sample: WheelSample, command: IssuedCommand | None, result: StepResult) -> None:
        """Show the present estimate."""
        now = time.monotonic()
        if not self._shown or now < self._due_s:
            return
        self._due_s = now + self._every_s
        speed, *parameters = (f"{m:.4g}±{s:.2g}" for m, s in zip(result.mean[1:5], result.std[1:5], strict=True))
        current = "  -  " if command is None else f"{1e3 * command.current_A:+7.1f} mA"
        line = (
            f"\r{result.time_s:9.1f} s {rpm_from_rad_s(result.mean[0]):+9.2f} rpm {current}  "
            f"k {speed}  b {parameters[0]}  c {parameters[1]}  s {parameters[2]}\x1b[K"
        )
        try:
            sys.stderr.write(line)
            sys.stderr.flush()
        except OSError:
            self._shown = False  # the terminal is gone; the run goes on

    def close(self) -> None:
        """Leave the cursor on a line of its own."""
        if self._shown:
            try:
                sys.stderr.write("\n")
            except OSError:
                self._shown = False


class ArraySink:
    """Collects a replay through the loop into the arrays that the compiled pass would have filled."""

    def __init__(self, n: int, advance: Callable[[int], object] = lambda n: None, size: int = len(STATE_NAMES)) -> None:
        import numpy as np

        from rw_ekf.filter import decisions

        self._codes = {outcome: getattr(decisions, outcome.name) for outcome in Outcome}
        self._row = 0
        self._advance = advance
        self.outcome: NDArray[np.int8] = np.zeros(n, np.int8)
        self.innovation: NDArray[np.float64] = np.full(n, np.nan)
        self.variance: NDArray[np.float64] = np.full(n, np.nan)
        self.states: NDArray[np.float64] = np.zeros((n, size))
        self.stds: NDArray[np.float64] = np.zeros((n, size))

    def write(self, sample: WheelSample, command: IssuedCommand | None, result: StepResult) -> None:
        """Take the next row."""
        i = self._row
        self.outcome[i] = self._codes[result.outcome]
        self.states[i] = result.mean
        self.stds[i] = result.std
        if result.innovation is not None:
            self.innovation[i] = result.innovation.innovation_rad_s
            self.variance[i] = result.innovation.std_rad_s**2
        self._row = i + 1
        if self._row % 100 == 0:
            self._advance(100)

    def close(self) -> None:
        """Nothing to finish."""

    def as_run(self, mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> FilterRun:
        """Return the run, given the estimator's final belief."""
        from rw_ekf.filter.log_filter import FilterRun

        return FilterRun(mean, covariance, self.innovation, self.variance, self.outcome, self.states, self.stds, None)


class SyncSink:
    """Forces the files of a run onto the disk every few seconds, in a thread, so that a power cut loses little."""

    def __init__(self, paths: list[Path], every_s: float = 10.0) -> None:
        self._paths = paths
        self._stop = threading.Event()
        self._every_s = every_s
        self._thread = threading.Thread(target=self._serve, name="disk-sync", daemon=True)
        self._thread.start()

    def write(self, sample: WheelSample, command: IssuedCommand | None, result: StepResult) -> None:
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
                    descriptor = os.open(path, os.O_RDONLY)
                    try:
                        os.fsync(descriptor)
                    finally:
                        os.close(descriptor)
                except OSError:
                    continue
            if ended:
                return
