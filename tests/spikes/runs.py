"""Directories of runs for tests: metadata, a short log and events, as a daemon leaves them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from rw_ekf.logs.metadata import RunMetadata, utc_text, write_metadata
from rw_ekf.records import WheelIdentity

BEGAN = datetime(2026, 1, 1, tzinfo=UTC)


def write_run(
    directory: Path,
    day: float,
    hours: float,
    spikes_h: Sequence[float],
    *,
    serial: int | None = 7,
    ended: bool = True,
    end: str | None = "faded",
    watched: bool = True,
    size_mNm: float = 0.5,
) -> Path:
    """Write a run that begins on a day and is TRACKING for so many hours, with spikes so many hours after its start.

    end: how every spike ended, None: none is over. Returns the log.
    """
    began = BEGAN + timedelta(days=day)
    log = directory / f"{began:%Y-%m-%dT%H-%M-%SZ}_wheel.csv"
    directory.mkdir(exist_ok=True)
    end_s = 3600.0 * hours
    log.write_text(f"time_s,speed_rad_s,current_command_A\n0.0,100.0,0.1\n0.1,100.0,0.1\n{end_s},100.0,0.1\n")
    configuration = {"wheel": {"name": "wheel"}, "watch": {"enabled": watched}}
    identity = WheelIdentity(serial_number=serial)
    write_metadata(log, RunMetadata(utc_text(began), "sim", "0.1.0", identity, configuration))
    events: list[dict[str, Any]] = [
        _state(began, None, "CONNECTING"),
        _state(began, 0.0, "TRACKING"),
    ]
    for hour in spikes_h:
        at = began + timedelta(hours=hour)
        spike = {
            "name": "drag_spike", "since_utc": f"{at:%Y-%m-%dT%H:%M:%SZ}", "since_s": 3600.0 * hour,
            "amplitude_rad_s2": size_mNm / 1.5, "amplitude_mNm": size_mNm, "std_mNm": 0.05 * size_mNm,
            "speed_rad_s": 28.4, "coulomb_rad_s2": 0.6,
        }  # fmt: skip
        when = {"utc": utc_text(at), "time_s": 3600.0 * hour + 2.0}
        events.append({**when, "event": "alarm", **spike})
        if end is not None:
            events.append({**when, "event": "alarm_over", **spike, "decay_s": 400.0, "end": end})
    if ended:
        over = began + timedelta(hours=hours)
        events.append({"utc": utc_text(over), "time_s": end_s, "event": "ended", "state": "TRACKING"})
    text = "".join(json.dumps(event) + "\n" for event in events)
    log.with_name(log.name.replace(".csv", ".events.jsonl")).write_text(text)
    return log


def _state(moment: datetime, time_s: float | None, state: str) -> dict[str, Any]:
    return {"utc": utc_text(moment), "time_s": time_s, "event": "state", "state": state, "was": None, "reason": "."}
