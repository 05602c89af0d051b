"""A daemon in this process on a virtual clock, over a wheel simulated in this process."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rw_ekf.clock import VirtualClock
from rw_ekf.commands.inputs import read_wheel_model
from rw_ekf.drivers.sim.plant_batch import compiled_advance
from rw_ekf.drivers.sim.plant_parameters import PlantNoise
from rw_ekf.drivers.sim.simulated_wheel import SimulatedProtocol, SimulatedWheel
from rw_ekf.learning.run_start import GivenModel
from rw_ekf.live.daemon import Task, run_daemon
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.settings.load import load_configuration
from rw_ekf.units import RAD_S_PER_RPM
from tests.live.bench import write_config
from tests.live.daemon import Notes, Ran

Event = tuple[float, Callable[[SimulatedWheel, StopSignal], object]]
USUAL: dict[str, dict[str, Any]] = {
    "loop": {"rate_hz": 2.0},
    "limits": {"silence_s": 1.5},
    "command": {"profile": "random-sines", "amplitude_A": 0.1, "period_s": 40.0},
}


def setting(**values: bool) -> Callable[[SimulatedWheel, StopSignal], object]:
    """An event that sets attributes of the wheel."""

    def happen(wheel: SimulatedWheel, stop: StopSignal) -> None:
        for name, value in values.items():
            setattr(wheel, name, value)

    return happen


def run(
    directory: Path, duration_s: float | None, *events: Event, speed_rad_s: float = 20.0, **changes: dict[str, Any]
) -> tuple[Ran, SimulatedWheel]:
    """Run the daemon; each event is a time [s] and what happens then. changes: of the configuration's sections."""
    clock, noise, notes = VirtualClock(), PlantNoise(RAD_S_PER_RPM), Notes()
    wheel = SimulatedWheel(
        noise=noise, seed=4, initial_speed_rad_s=speed_rad_s, clock=clock, fine_step_s=0.02, law=compiled_advance
    )
    path = write_config(directory, str(directory / "nowhere"), **(USUAL | changes))
    with StopSignal() as stop:
        for time_s, action in events:
            clock.at(time_s, lambda action=action: action(wheel, stop))  # type: ignore[misc]
        protocol = SimulatedProtocol(wheel)
        configuration = load_configuration(path)
        given = GivenModel(read_wheel_model(None, configuration), configuration.filter.model)
        outcome = run_daemon(Task(configuration, protocol, given, duration_s), notes, stop, clock)
    return Ran(outcome, notes), wheel


def published(directory: Path, after_s: float) -> dict[str, Any]:
    """The state file, once it is of a time after that; its thread keeps the computer's time."""
    end_s = time.monotonic() + 15.0
    while True:
        with contextlib.suppress(StopIteration, FileNotFoundError):
            path = next((directory / "runs").glob("*.state.json"))
            document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            if document["time_s"] is not None and document["time_s"] > after_s:  # None: before the first sample
                return document
        assert time.monotonic() < end_s, "not published in time"
        time.sleep(0.002)
