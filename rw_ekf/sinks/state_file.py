"""What a run is doing at this moment as one small JSON file, replaced whole each time; `rw-ekf status` reads it."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rw_ekf.errors import RwEkfError
from rw_ekf.json_output import json_text
from rw_ekf.logs.atomic import write_text
from rw_ekf.logs.metadata import utc_text
from rw_ekf.records import Tick

if TYPE_CHECKING:
    from rw_ekf.sinks.all_sinks import RunContext

SCHEMA = "rw_ekf.state/1"
_OF_TICK = (
    "time_s", "outcome", "state", "std", "valid", "filter_health", "current_command_A", "temperature_degC",
)  # fmt: skip


class StateFileSink:
    """Publishes the beginning of a run, every tick that it is given, and the end."""

    def __init__(self, run: RunContext) -> None:
        self._run = run
        self._last: Tick | None = None
        self._publish(None)

    def write(self, tick: Tick) -> None:
        """Replace the file."""
        self._last = tick
        self._publish(None)

    def close(self) -> None:
        """Say that the run has ended, and how it stood then; of one that crashed only how it stood."""
        self._publish(utc_text(self._run.clock.utc()) if self._run.in_order() else None)

    def _publish(self, ended_utc: str | None) -> None:
        run, tick = self._run, self._last
        now = run.began if tick is None or tick.state is None else tick.state
        document = {
            "schema": SCHEMA,
            "wheel": run.wheel,
            "port": run.port,
            "log": run.files.log.name,
            **run.process,
            "utc": utc_text(run.clock.utc()),
            "period_s": run.period_s,
            "began_utc": run.began.since_utc,
            "ended_utc": ended_utc,
            "run_state": now.state.value,
            "since_utc": now.since_utc,
            "reason": run.halted() or now.reason,
            "link": {"state": None if tick is None else tick.link.value, **asdict(run.link())},
            **_of_tick(tick),
        }
        if tick is not None and tick.compensation is not None:
            document["compensation"] = tick.compensation._asdict()
        if run.watched:
            document["alarms"] = [] if tick is None else [alarm.document() for alarm in tick.alarms]
        try:
            write_text(run.files.state, json_text(document), follow=False)
        except (OSError, ValueError, RwEkfError) as error:  # it describes the moment: the next one is tried
            if not run.unwritten.state_files:
                do = "`status` and the page show what was published last, until there is room or the place is back"
                run.logger.error("not_published", file=str(run.files.state), reason=str(error), do=do)
            run.unwritten.state_files += 1


def _of_tick(tick: Tick | None) -> dict[str, Any]:
    if tick is None:
        return dict.fromkeys(_OF_TICK)
    estimate = tick.estimate
    return {
        "time_s": estimate.time_s,
        "outcome": estimate.outcome.value,
        "state": {**estimate.state._asdict(), **{name: c.value for name, c in estimate.effects.items()}},
        "std": {**estimate.std._asdict(), **{name: c.std for name, c in estimate.effects.items()}},
        "valid": None if estimate.valid is None else estimate.valid._asdict(),
        "filter_health": None if estimate.health is None else asdict(estimate.health),
        "current_command_A": None if tick.command is None else tick.command.current_A,
        "temperature_degC": tick.sample.temperature_degC,
    }
