"""A run as PlotJuggler takes it: a JSON object over UDP for each sample (its UDP Server, protocol json)."""

from __future__ import annotations

import json
from typing import Any

from rw_ekf.errors import BadInputError
from rw_ekf.records import RunState, Tick
from rw_ekf.sinks.all_sinks import RunContext
from rw_ekf.sinks.recorders.datagrams import Datagrams
from rw_ekf.sinks.recorders.tick_record import TickRecords

NEEDS = ()
_STATES = {state.value: number for number, state in enumerate(RunState)}


class PlotJugglerRecorder:
    """One datagram for each sample; what is not known is left out, for a curve has no null."""

    leaves_file = False

    def __init__(self, run: RunContext) -> None:
        """Raises BadInputError for a place that is none."""
        self._run = run
        self._records = TickRecords(run.clock, run.began, run.state_names)
        place = str(run.output.plotjuggler)
        try:
            self._datagrams = Datagrams("plotjuggler", place, self._missed, run.logger.warning)
        except OSError as error:
            raise BadInputError(f"output.plotjuggler: {place} is no place on a network ({error}): mend it") from None

    def write(self, tick: Tick) -> None:
        """Send a sample and its estimate."""
        record = self._records.of(tick)
        if record.sample is None or record.estimate is None:
            return
        message: dict[str, Any] = {
            "timestamp": record.stamp_ns * 1e-9,
            "rw_ekf": {
                "sample": _numbers(record.sample),
                "estimate": _numbers(record.estimate),
                "alarms": len(tick.alarms),
                **({} if record.state is None else {"state": _STATES[record.state]}),
            },
        }
        self._datagrams.send(json.dumps(message, allow_nan=False).encode())

    def lost(self, ticks: int) -> None:
        """A curve has a gap."""

    def _missed(self, ticks: int, reason: str) -> None:
        self._run.unwritten.miss("plotjuggler", ticks, reason, self._run.logger.error)

    def close(self) -> None:
        """Send no more."""
        self._datagrams.close()


recorder_of = PlotJugglerRecorder


def _numbers(values: dict[str, Any]) -> dict[str, float]:
    return {key: value for key, value in values.items() if isinstance(value, bool | int | float)}
