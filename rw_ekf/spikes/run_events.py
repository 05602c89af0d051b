"""What the events of one run say of drag spikes, and for how long the wheel was watched."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rw_ekf.errors import LogError, RwEkfError
from rw_ekf.logs.metadata import moment_of, read_metadata, seconds_between
from rw_ekf.logs.parts import beside, parts_of
from rw_ekf.logs.reader import read_log
from rw_ekf.numbers import number_of
from rw_ekf.plain_file import json_of, read_plain
from rw_ekf.units import rpm_from_rad_s

SPIKE = "drag_spike"
# Readings come. A spike itself gates readings, and so degrades a run: were that time left out, each spike would shorten
# the time that its own incidence is taken over.
WATCHED_STATES = ("TRACKING", "DEGRADED")
_MOST_BYTES = 100_000_000  # some 500,000 events
GENUINE_ENDS = ("faded", "another one set in")  # others were taken back by the watch


@dataclass(frozen=True)
class Spike:
    """One spike; None for what is not known."""

    run: str  # the log's name
    utc: str  # of its onset
    watched_s: float  # from the beginning of all that was watched in the run
    speed_rpm: float | None
    amplitude_mNm: float | None
    std_mNm: float | None
    percent_of_coulomb: float | None
    decay_s: float | None
    end: str | None  # as the watch reported; None: the run ended first
    since_start_s: float | None = None  # from the run's start to its onset


@dataclass
class RunEvents:
    """One run: its spikes in the order of their onset, and how long it was watched."""

    wheel: str
    log: Path
    watched_s: float = 0.0
    began_utc: str | None = None  # its first event
    spikes: list[Spike] = field(default_factory=list)
    alarms: list[str] = field(default_factory=list)  # when each one of the watch began, spikes included, UTC
    warnings: list[str] = field(default_factory=list)


def read_run(log: Path) -> RunEvents | None:
    """Read the events of a run; None where nothing watched it for spikes.

    Raises ConfigError for damaged metadata, LogError for events that cannot be read.
    """
    metadata = read_metadata(log)
    assert metadata is not None, "runs_of gives runs with metadata alone"
    name = str(_section(metadata.configuration, "wheel").get("name", "wheel"))
    serial = None if metadata.identity is None else metadata.identity.serial_number
    wheel = name if serial is None else f"{name} (serial number {serial})"
    run = RunEvents(wheel, log)
    path = beside(log, "events.jsonl")
    if not _section(metadata.configuration, "watch").get("enabled", True):
        return None
    try:
        lines = read_plain(path, _MOST_BYTES).splitlines()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror})") from None
    events = []
    for number, line in enumerate(lines, 1):
        event = _event(line)
        if event is None:
            run.warnings.append(f"{path}:{number}: is no event, and is left out (a line cut short by a crash)")
        else:
            events.append(event)
    _follow(run, events)
    return run


def _section(configuration: Any, name: str) -> dict[str, Any]:
    """A section of a configuration that nobody has checked since it was written."""
    found = configuration.get(name) if isinstance(configuration, dict) else None
    return found if isinstance(found, dict) else {}


def _event(line: bytes) -> dict[str, Any] | None:
    event = json_of(line)
    well_formed = isinstance(event, dict) and isinstance(event.get("event"), str) and moment_of(event.get("utc"))
    return event if well_formed else None


def _follow(run: RunEvents, events: list[dict[str, Any]]) -> None:
    """Add up the time watched, and take up each spike where it sets in and where it is over."""
    run.began_utc = str(events[0]["utc"]) if events else None
    if events and events[-1]["event"] != "ended":
        events = [*events, *_cut_off(run, events[-1])]
    state, since = None, None
    begun: dict[float, int] = {}  # place of each spike that is on, by its onset
    for event in events:
        elapsed_s = 0.0 if since is None or state not in WATCHED_STATES else _elapsed_s(since, event)
        if event["event"] == "alarm":
            run.alarms.append(str(event.get("since_utc")))
        if event["event"] == "alarm" and event.get("name") == SPIKE:
            begun[number_of(event.get("since_s")) or 0.0] = len(run.spikes)
            run.spikes.append(_spike(run, event, run.watched_s + max(elapsed_s - _noticed_after_s(event), 0.0), None))
        elif event["event"] == "alarm_over" and event.get("name") == SPIKE:
            place = begun.pop(number_of(event.get("since_s")) or 0.0, None)
            if place is not None:
                run.spikes[place] = _spike(run, event, run.spikes[place].watched_s, event.get("end"))
        elif event["event"] in {"state", "ended"}:
            run.watched_s += elapsed_s
            state, since = event.get("state"), event
            if event["event"] == "ended":
                state = None


def _cut_off(run: RunEvents, last: dict[str, Any]) -> list[dict[str, Any]]:
    """The end that a crash has left out: the time of the last row of the log."""
    run.warnings.append(f"{run.log}: the run was cut off; it counts up to its last row")
    last_s, run_s = number_of(last.get("time_s")), number_of(last.get("run_s"))
    try:
        end_s = float(read_log(parts_of(run.log).files[-1]).time_s[-1])
    except (RwEkfError, IndexError):
        end_s = last_s or 0.0
    if run_s is not None:
        run_s += max(end_s - (last_s or 0.0), 0.0)
    return [{"utc": last["utc"], "time_s": end_s, "run_s": run_s, "event": "ended"}]


def _spike(run: RunEvents, event: dict[str, Any], watched_s: float, end: str | None) -> Spike:
    speed, amplitude, coulomb = (
        number_of(event.get(key)) for key in ("speed_rad_s", "amplitude_rad_s2", "coulomb_rad_s2")
    )
    return Spike(
        run=run.log.name,
        utc=str(event.get("since_utc")),
        since_start_s=seconds_between(run.began_utc, event.get("since_utc")),
        watched_s=watched_s,
        speed_rpm=None if speed is None else rpm_from_rad_s(speed),
        amplitude_mNm=number_of(event.get("amplitude_mNm")),
        std_mNm=number_of(event.get("std_mNm")),
        percent_of_coulomb=None if amplitude is None or not coulomb else 100.0 * amplitude / abs(coulomb),
        decay_s=number_of(event.get("decay_s")),
        end=end,
    )


def _noticed_after_s(alarm: dict[str, Any]) -> float:
    """How long after its onset an alarm was raised, by the wheel's clock."""
    since_s, now_s = number_of(alarm.get("since_s")), number_of(alarm.get("time_s"))
    return 0.0 if since_s is None or now_s is None else max(now_s - since_s, 0.0)


def _elapsed_s(since: dict[str, Any], until: dict[str, Any]) -> float:
    """Time between two events, by the run's own clock.

    In a file without it: by the wheel's where that has not begun anew, else by the day's.
    """
    for clock in ("run_s", "time_s"):
        first, last = number_of(since.get(clock)), number_of(until.get(clock))
        if first is not None and last is not None and last >= first:
            return last - first
    begin, end = moment_of(since["utc"]), moment_of(until["utc"])
    assert begin is not None
    assert end is not None
    return max((end - begin).total_seconds(), 0.0)
