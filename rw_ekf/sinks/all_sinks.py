"""Every sink of a run by its name: those here, and those of installed packages (entry points rw_ekf.sinks)."""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from rw_ekf.clock import Clock
from rw_ekf.control.commanders import Phase
from rw_ekf.errors import BadInputError, RwEkfError
from rw_ekf.logs.parts import part_path
from rw_ekf.logs.record_print import RecordPrint
from rw_ekf.logs.writer import EstimateWriter, SampleWriter
from rw_ekf.plugins import added, loaded_as, refused
from rw_ekf.records import LinkCounters, Sink, StateNow, Tick
from rw_ekf.settings.schema import OutputSection
from rw_ekf.sinks.events import EventsSink
from rw_ekf.sinks.guarded_sink import GuardedSink, Queue
from rw_ekf.sinks.learned_sink import LearnedSink, Learning
from rw_ekf.sinks.log import LogSink, PartFiles, PartSize
from rw_ekf.sinks.packer import Packer
from rw_ekf.sinks.recent import RecentSink
from rw_ekf.sinks.run_files import RunFiles, Unwritten
from rw_ekf.sinks.state_file import StateFileSink
from rw_ekf.sinks.status_line import StatusLine
from rw_ekf.statistics import LoopTiming, RunStatistics

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

_LOG_TICKS = 4096  # seven minutes at 10 Hz of a disk that hangs
_SLOW_TICKS = 600  # a minute at 10 Hz of somebody who does not keep up
_STATE_EVERY_S = 1.0
LEARNED_EVERY_S = 60.0


@dataclass(frozen=True)
class RunContext:
    """What the sinks of a run may need of it."""

    files: RunFiles
    wheel: str
    output: OutputSection
    port: str
    state_names: tuple[str, ...]
    clock: Clock
    logger: Any
    began: StateNow
    link: Callable[[], LinkCounters]
    process: Mapping[str, int | None]  # pid and start_ticks: for all time the name of one process
    in_order: Callable[[], bool] = lambda: True  # whether the run, when it is over, has not crashed
    halted: Callable[[], str | None] = lambda: None  # why it ended before its time, where the wheel must not be driven
    compensated: bool = False  # whether friction may be compensated
    period_s: float = 0.1  # of the loop
    total_s: Callable[[], float | None] = lambda: None
    phase: Phase | None = None
    label: str = ""  # of the wheel, where several are shown on one terminal
    watched: bool = True  # whether there can be alarms
    statistics: RunStatistics = field(default_factory=RunStatistics)
    learning: Learning | None = None  # None: nothing is kept for the next run
    requests: Sink | None = None  # who takes a controller's requests, and informs it of each turn; None: nobody
    recent: RecentSink = field(default_factory=RecentSink)
    timing: LoopTiming = field(default_factory=LoopTiming)
    unwritten: Unwritten = field(default_factory=Unwritten)
    record: RecordPrint = field(default_factory=RecordPrint)


class SinkKind(NamedTuple):
    """How a sink is made, and which turns it takes."""

    make: Callable[[RunContext], tuple[Sink, Queue | None] | None]  # None: such a run has none
    every_turn: bool = False  # also those that brought no sample


class StatisticsSink:
    """Counts every tick."""

    def __init__(self, statistics: RunStatistics) -> None:
        self._statistics = statistics
        self._segment: int | None = None

    def write(self, tick: Tick) -> None:
        """Count one tick."""
        self._statistics.add(tick.estimate, same_segment=tick.sample.segment == self._segment)
        self._segment = tick.sample.segment

    def close(self) -> None:
        """Nothing to finish."""


def _log(run: RunContext) -> tuple[Sink, Queue]:
    def open_part(number: int) -> PartFiles:
        samples = SampleWriter(part_path(run.files.log, number))
        try:
            path, every_s = part_path(run.files.estimates, number), run.output.estimates_every_s
            return PartFiles(samples, EstimateWriter(path, run.state_names, every_s, compensated=run.compensated))
        except BadInputError:
            samples.close()
            samples.path.unlink(missing_ok=True)
            raise

    size = PartSize(3600.0 * run.output.part_hours, 1e6 * run.output.part_megabytes)
    note = run.logger.warning
    sink = LogSink(open_part, size, Packer(note), run.clock, run.unwritten, note, run.record)
    return sink, Queue(_LOG_TICKS, lost=sink.lost)


def _state(run: RunContext) -> tuple[Sink, Queue]:
    return StateFileSink(run), Queue(1, every_s=_STATE_EVERY_S)


def _events(run: RunContext) -> tuple[Sink, Queue]:
    return EventsSink(run.files.events, run.clock, run.began), Queue(_LOG_TICKS)


def _learned(run: RunContext) -> tuple[Sink, Queue] | None:
    if run.learning is None:
        return None
    return LearnedSink(run, run.learning, LEARNED_EVERY_S), Queue(1, every_s=LEARNED_EVERY_S)


def _requests(run: RunContext) -> tuple[Sink, None] | None:
    return None if run.requests is None else (run.requests, None)


class Recorder(Sink, Protocol):
    """What `recorder_of(run)` of a recorder's module gives; NEEDS names the packages that it takes."""

    leaves_file: bool  # every tick is in the system's hands before the next; one that is lost is missing from the run

    def lost(self, ticks: int) -> None:
        """Take note of ticks that never came."""
        ...


def _recorder(name: str) -> SinkKind:
    def made(run: RunContext) -> tuple[Sink, Queue] | None:
        if not getattr(run.output, name):
            return None
        module = importlib.import_module(f"rw_ekf.sinks.recorders.{name}")
        for needed in module.NEEDS:
            try:
                importlib.import_module(needed)
            except ImportError as error:
                raise BadInputError(
                    f'output.{name}: what it needs is not installed ({error}): pip install "rw-ekf[recorders]", or '
                    "leave the key out"
                ) from None
        recorder: Recorder = module.recorder_of(run)

        def lost(ticks: int) -> None:
            recorder.lost(ticks)
            reason = f"{name} does not keep up"
            run.unwritten.miss(name, ticks, reason, run.logger.error, from_file=recorder.leaves_file)

        return recorder, Queue(_SLOW_TICKS, lost=lost, at_once=recorder.leaves_file, waits=False)

    return SinkKind(made, every_turn=True)


_RECORDERS = {name: _recorder(name) for name in ("mcap", "prometheus", "influx", "plotjuggler", "mqtt")}


SINKS: dict[str, SinkKind] = {
    "log": SinkKind(_log),
    "statistics": SinkKind(lambda run: (StatisticsSink(run.statistics), None)),
    "recent": SinkKind(lambda run: (run.recent, None)),
    "state": SinkKind(_state, every_turn=True),
    "events": SinkKind(_events, every_turn=True),
    "learned": SinkKind(_learned),
    "requests": SinkKind(_requests, every_turn=True),
    "status": SinkKind(
        lambda run: (StatusLine(run.logger, run.clock, run.total_s, run.phase, label=run.label), None),
        every_turn=True,
    ),
    **_RECORDERS,
}


def _all_sinks() -> dict[str, SinkKind]:
    """Those of rw_ekf and of installed packages, which never keep the loop waiting. Raises ConfigError."""
    found = dict(SINKS)
    for name, point in added("rw_ekf.sinks", SINKS).items():
        kind = loaded_as(SinkKind, point)
        found[name] = kind._replace(make=_queued(point, kind.make))
    return found


def _queued(point: EntryPoint, make: Callable[[RunContext], tuple[Sink, Queue | None] | None]) -> Any:
    """The same, in a thread of its own, and any error while it is made in words."""

    def made(run: RunContext) -> tuple[Sink, Queue] | None:
        try:
            parts = make(run)
        except RwEkfError:
            raise
        except Exception as error:
            raise refused(point, f"could not be made ({type(error).__name__}: {error})") from error
        return None if parts is None else (parts[0], parts[1] or Queue(_SLOW_TICKS))

    return made


def sinks_of(run: RunContext) -> list[GuardedSink]:
    """Every sink of a run behind its guard; raises BadInputError where one cannot be made."""
    with contextlib.ExitStack() as undo:
        made = []
        for name, kind in _all_sinks().items():
            parts = kind.make(run)
            if parts is None:
                continue
            sink, queue = parts
            guarded = GuardedSink(
                name, sink, queue, run.clock, run.unwritten, run.logger.error, every_turn=kind.every_turn
            )
            made.append(guarded)
            undo.callback(made[-1].close)
        undo.pop_all()
    return made
