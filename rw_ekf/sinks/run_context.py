"""What the sinks of a run may need of it, and what makes one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from rw_ekf.clock import Clock
from rw_ekf.control.commanders import Phase
from rw_ekf.logs.record_print import RecordPrint
from rw_ekf.records import LinkCounters, Sink, StateNow
from rw_ekf.settings.schema import OutputSection
from rw_ekf.sinks.guarded_sink import Queue
from rw_ekf.sinks.learned_sink import Learning
from rw_ekf.sinks.recent import RecentSink
from rw_ekf.sinks.run_files import RunFiles, Unwritten
from rw_ekf.statistics import LoopTiming, RunStatistics


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
    compensated: bool = False  # whether friction may be compensated
    total_s: Callable[[], float | None] = lambda: None
    phase: Phase | None = None
    label: str = ""  # of the wheel, where several are shown on one terminal
    watched: bool = True  # whether there can be alarms
    statistics: RunStatistics = field(default_factory=RunStatistics)
    learning: Learning | None = None  # None: nothing is kept for the next run
    requests: Sink | None = None  # who takes a controller's requests, and tells it of each turn; None: nobody
    recent: RecentSink = field(default_factory=RecentSink)
    timing: LoopTiming = field(default_factory=LoopTiming)
    unwritten: Unwritten = field(default_factory=Unwritten)
    record: RecordPrint = field(default_factory=RecordPrint)


class SinkKind(NamedTuple):
    """How a sink is made, and which turns it takes."""

    make: Callable[[RunContext], tuple[Sink, Queue | None] | None]  # None: such a run has none
    every_turn: bool = False  # also those that brought no sample
