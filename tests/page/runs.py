"""A run of a simulated wheel as a daemon leaves it, without the daemon: files beside each other under one stem."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from rw_ekf.clock import SystemClock
from rw_ekf.live.process import own_process
from rw_ekf.logs.metadata import utc_text

NAME = "2026-11-27T10-20-06Z_wheel"
LOG = "time_s,speed_rad_s,current_command_A,current_A,command_delay_s,segment,temperature_degC"
ESTIMATES = (
    "time_s,speed_rad_s,motor_gain,viscous,coulomb,static,std_speed_rad_s,std_motor_gain,std_viscous,std_coulomb,"
    "std_static,innovation_rad_s,innovation_std_rad_s,nis,accepted,reason"
)


class RunOnDisk:
    """Rows are written as a daemon does: line by line; the belief whole in every tenth row."""

    def __init__(self, folder: Path, name: str = NAME) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self.name, self.rows = folder, name, 0
        self.log, self.estimates = folder / f"{name}.csv", folder / f"{name}.estimates.csv"
        self.events = folder / f"{name}.events.jsonl"
        (folder / f"{name}.meta.yaml").write_text("schema: rw_ekf.log/1\n")
        self.log.write_text(LOG + "\n")
        self.estimates.write_text(ESTIMATES + "\n")
        self.events.write_text("")

    def add(self, count: int) -> None:
        """Rows of a wheel that swings between 40 rad/s and -40."""
        with self.log.open("a") as log, self.estimates.open("a") as estimates:
            for _ in range(count):
                t = 100.0 + 0.1 * self.rows
                speed = 40.0 * math.sin(0.05 * self.rows)
                log.write(f"{t:.4f},{speed!r},{0.1 * math.cos(0.05 * self.rows)!r},0.0,0.05,0,21.5\n")
                whole = f"{speed!r},15.0,0.003,0.5,0.6,0.1,2.0,0.001,0.1,0.1" if self.rows % 10 == 0 else "," * 9
                estimates.write(f"{t:.4f},{whole},0.01,0.1,{0.9 if self.rows != 77 else 99.0},true,\n")
                self.rows += 1

    def publish(self, **more: Any) -> None:
        """What the daemon publishes of itself; by default of this process, which lives."""
        state: dict[str, Any] = {
            "schema": "rw_ekf.state/1", "wheel": "wheel", "port": "/dev/x", "log": self.log.name, **own_process(),
            "run_state": "TRACKING", "since_utc": "2026-11-27T10:20:28.6Z", "reason": "readings come and are used",
            "utc": utc_text(SystemClock().utc()), "alarms": [], "link": {"state": "answered", "requests": 9},
            "state": {"speed_rad_s": 1.0, "motor_gain": 15.0}, "std": {"speed_rad_s": 0.1, "motor_gain": 2.0},
        }  # fmt: skip
        (self.folder / "wheel.state.json").write_text(json.dumps(state | more))

    def tell(self, **event: Any) -> None:
        """One more event."""
        with self.events.open("a") as events:
            events.write(json.dumps(event) + "\n")
