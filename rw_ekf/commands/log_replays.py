"""What `rw-ekf replay` does with the logs that are named: one after the other, or many of them on all cores."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.commands.first_use import make_ready
from rw_ekf.commands.inputs import tell_of_log
from rw_ekf.console import STATUS, logger, printable, progress
from rw_ekf.errors import EmptyLogError, RwEkfError
from rw_ekf.logs.column_map import ColumnMap

if TYPE_CHECKING:
    from rw_ekf.log_replay import Run
    from rw_ekf.logs.long_log import LongLog
    from rw_ekf.logs.wheel_log import WheelLog
    from rw_ekf.long_replay import Writer
    from rw_ekf.settings.schema import Configuration
    from rw_ekf.starting_point import FilterSetup
    from rw_ekf.wheel.model_file import WheelModel

# What is left to do is shared among the cores where one would take longer [s]. A process of one's own begins to work
# after .5 s, so that two of them are done with 2 s of work after 1.5 s; 1.4 or 2.6 s would gain or lose a quarter.
_SHARED_S = 2.0


@dataclass(frozen=True)
class NamedLog:
    """A log to replay."""

    path: str
    from_own_start: bool  # that of the run which wrote it
    must_have_rows: bool  # named itself: a run of a directory may have ended before its first row


@dataclass(frozen=True)
class Done:
    """What is kept of a replayed log: not its rows, for there may be a thousand."""

    entry: dict[str, Any]  # of the document
    text: str
    run: Run | None  # for its picture, where one was requested


@dataclass
class LogReplays:
    """What is requested, and how long it took."""

    args: argparse.Namespace
    configuration: Configuration | None
    model: WheelModel | None
    columns: ColumnMap
    named: Sequence[NamedLog]
    seconds: dict[str, float] = field(default_factory=dict)

    def replay(self, *, in_parts: bool) -> list[Done]:
        """Read, filter and write each log. Raises UnsoundError where one cannot be read in parts."""
        self._check_there()
        self.seconds = dict.fromkeys(("read", "filter", "write"), 0.0)
        done: list[Done] = []
        with self._writer() as write, _progress(len(self.named) > 1, len(self.named), " logs") as advance:
            for index, log in enumerate(self.named):
                began_s = time.perf_counter()
                done += self.replayed(log, write, in_parts=in_parts)
                advance(1)
                rest = self.named[index + 1 :]
                # The first took what the program takes to load as well, and a table has one writer.
                if index > 0 and write is None and len(rest) * (time.perf_counter() - began_s) > _SHARED_S:
                    return done + self._on_all_cores(rest, advance, in_parts=in_parts)
        return done

    def replayed(self, named: NamedLog, write: Writer | None, *, in_parts: bool) -> list[Done]:
        """Read, filter and write one log; nothing of a run that ended before its first row."""
        from rw_ekf import compile_ahead
        from rw_ekf.log_replay import setup_of_run

        setup = setup_of_run(Path(named.path)) if named.from_own_start else None
        log = self._read(named, setup, in_parts=in_parts)
        if log is None:
            return []
        with_effects = any(start is not None and start.effects.size > 0 for start in (self.model, setup))
        with_record = (*compile_ahead.FILTER, *(compile_ahead.SMOOTHER if self.args.smooth else ()))
        make_ready((*with_record, *compile_ahead.EFFECTS) if with_effects else compile_ahead.FIT)
        with _progress(len(self.named) == 1, len(log), " samples") as advance, self._timed("filter"):
            run = self._filtered(log, setup, write, advance)
        return [Done(run.entry(), run.text(), None if self.args.picture is None else run)]

    def _on_all_cores(
        self, rest: Sequence[NamedLog], advance: Callable[[int], object], *, in_parts: bool
    ) -> list[Done]:
        from concurrent.futures.process import BrokenProcessPool

        from rw_ekf.compiled import Kernel
        from rw_ekf.worker_pool import workers

        done: list[Done] = []
        work = partial(_in_worker, self, plain=Kernel.interpreting, in_parts=in_parts)
        try:
            with workers(len(rest)) as pool:
                for more, seconds in pool.map(work, rest):
                    done += more
                    for what, took_s in seconds.items():
                        self.seconds[what] += took_s
                    advance(1)
        except BrokenProcessPool:
            raise RwEkfError(
                "a process that replayed a part of the logs was ended from outside, mostly for want of memory: "
                "replay fewer logs at a time"
            ) from None
        return done

    def _check_there(self) -> None:
        """Raise LogError where a log is not there, or is of no known form: before work is done on others."""
        from rw_ekf.logs.formats import format_of
        from rw_ekf.logs.parts import parts_of

        for named in self.named:
            for file in parts_of(Path(named.path)).files[:1]:
                format_of(file, str(file))

    def _read(self, named: NamedLog, setup: FilterSetup | None, *, in_parts: bool) -> WheelLog | LongLog | None:
        from rw_ekf.logs.long_log import long_log_of
        from rw_ekf.logs.reader import read_log

        start = setup or self.model
        with self._timed("read"):
            try:
                carried = () if start is None else start.effects.columns
                long = long_log_of(Path(named.path), self.columns, carried) if in_parts else None
                log = long or read_log(named.path, self.columns)
                tell_of_log(log)
                return log
            except EmptyLogError as error:
                if named.must_have_rows:
                    raise
                logger().warning("left_out", text=str(error))
        return None

    def _filtered(
        self, log: WheelLog | LongLog, setup: FilterSetup | None, write: Writer | None, advance: Callable[[int], object]
    ) -> Run:
        from rw_ekf.log_replay import replay_log
        from rw_ekf.logs.long_log import LongLog
        from rw_ekf.logs.thinned import ThinnedRows
        from rw_ekf.long_replay import replay_long

        if isinstance(log, LongLog):
            rows = ThinnedRows(len(log)) if self.args.picture is not None else None
            takers = [taker for taker in (write, rows) if taker is not None]
            run = replay_long(log, self.configuration, self.model, setup, writers=takers, advance=advance)
            return run if rows is None else replace(run, picture_rows=rows.taken())
        run = replay_log(
            log, self.configuration, self.model, setup,
            with_columns=write is not None or self.args.picture is not None,
            smooth=self.args.smooth,
            online=self.args.online,
            advance=advance if self.args.online else lambda rows: None,
        )  # fmt: skip
        if write is not None and run.columns is not None:
            write(log, run.columns)
        return run

    @contextmanager
    def _writer(self) -> Iterator[Writer | None]:
        """What writes the table of all logs, if one is requested; several are under a first column `log`."""
        import numpy as np

        from rw_ekf.logs.tables import table_writer

        if self.args.out is None:
            yield None
            return
        with table_writer(self.args.out) as write:

            def written(log: WheelLog, columns: dict[str, Any]) -> None:
                of_log = {"log": np.full(len(log), printable(log.name), dtype=object)} if len(self.named) > 1 else {}
                with self._timed("write"):
                    write({**of_log, **columns})

            yield written

    @contextmanager
    def _timed(self, what: str) -> Iterator[None]:
        started = time.perf_counter()
        yield
        self.seconds[what] += time.perf_counter() - started


@contextmanager
def _progress(shown: bool, total: int, unit: str) -> Iterator[Callable[[int], object]]:
    """Of one log its samples are counted, of several the logs."""
    if not shown:
        yield lambda count: None
        return
    with progress("replay", total, unit) as bar:
        yield bar.update


def _in_worker(
    replays: LogReplays, named: NamedLog, *, plain: bool, in_parts: bool
) -> tuple[list[Done], dict[str, float]]:
    """Replay a log in a process of its own; also how long that took. plain: where nothing can be compiled."""
    from rw_ekf.compiled import stay_plain

    if plain:
        stay_plain()
    STATUS.tells = "verbose" in replays.args
    replays.seconds = dict.fromkeys(replays.seconds, 0.0)
    return replays.replayed(named, None, in_parts=in_parts), replays.seconds
