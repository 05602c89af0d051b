"""The recorders of a run: a key of `output` each, whose module is imported where that is set."""

from __future__ import annotations

import importlib
from typing import Protocol

from rw_ekf.errors import BadInputError
from rw_ekf.records import Sink
from rw_ekf.sinks.guarded_sink import Queue
from rw_ekf.sinks.run_context import RunContext, SinkKind

_TICKS = 600  # a minute at 10 Hz of somebody who does not keep up


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

        return recorder, Queue(_TICKS, lost=lost, at_once=recorder.leaves_file, waits=False)

    return SinkKind(made, every_turn=True)


RECORDERS = {name: _recorder(name) for name in ("mcap", "prometheus", "influx", "plotjuggler", "mqtt")}
