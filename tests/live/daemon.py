"""A daemon in this process: its run, what happens to the wheel meanwhile, and what it said."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from rw_ekf.attach.wire import checked_protocol
from rw_ekf.clock import SystemClock, VirtualClock
from rw_ekf.commands.inputs import read_wheel_model
from rw_ekf.drivers.line.register_protocol import RegisterProtocol
from rw_ekf.learning.run_start import GivenModel
from rw_ekf.live.daemon import Task, run_daemon
from rw_ekf.live.run_outcome import RunOutcome
from rw_ekf.live.stop_signal import RESUME, StopSignal
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.settings.load import load_configuration
from tests.live.bench import Bench

Event = tuple[float, Callable[[], object]]


@dataclass
class Notes:
    """A logger that keeps what it is told."""

    stated: list[tuple[str, dict[str, Any]]] = field(default_factory=list)

    def info(self, event: str, **context: Any) -> None:
        self.stated.append((event, context))

    warning = error = info

    @property
    def states(self) -> list[str]:
        """States that the run went to, in order."""
        return [str(context["state"]) for name, context in self.stated if name == "state"]

    @property
    def events(self) -> list[str]:
        """Names of the events, in order."""
        return [name for name, _ in self.stated]


@dataclass
class Ran:
    """A run that has ended."""

    outcome: RunOutcome
    notes: Notes

    @property
    def log(self) -> WheelLog:
        """The log that the run wrote."""
        return read_log(self.outcome.files.log)


def resume() -> None:
    """A person's word to a daemon in this process that holds zero."""
    os.kill(os.getpid(), RESUME)


def run(bench: Bench, duration_s: float, *events: Event, notes: Notes | None = None, **changes: dict[str, Any]) -> Ran:
    """Run the daemon on the bench's wheel; each event is a time [s] after the first request, and what happens then."""
    configuration = load_configuration(bench.config(**changes))
    given = GivenModel(read_wheel_model(None, configuration), configuration.filter.model)
    notes = notes if notes is not None else Notes()
    protocol = checked_protocol(configuration)
    with StopSignal() as stop:
        if bench.cable is not None:
            clock = bench.cable.clock
            assert isinstance(clock, VirtualClock)
            for at_s, action in events:
                clock.at(clock.monotonic() + at_s, action)
            assert isinstance(protocol, RegisterProtocol)
            carried = bench.cable.carrying(protocol)
            return Ran(run_daemon(Task(configuration, carried, given, duration_s), notes, stop, clock), notes)
        with _happening(bench, events):
            outcome = run_daemon(Task(configuration, protocol, given, duration_s), notes, stop, SystemClock())
    return Ran(outcome, notes)


@contextmanager
def _happening(bench: Bench, events: tuple[Event, ...]) -> Iterator[None]:
    over = threading.Event()
    thread = threading.Thread(target=_happen, args=(bench, events, over), daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join(10.0)


def _happen(bench: Bench, events: tuple[Event, ...], over: threading.Event) -> None:
    while not bench.recorder.requests and not over.wait(0.005):
        pass
    began_s = time.monotonic()
    for at_s, action in events:
        if over.wait(max(began_s + at_s - time.monotonic(), 0.0)):
            return
        action()
