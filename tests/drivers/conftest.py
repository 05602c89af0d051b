"""What the driver tests share: the project's wire map, and a simulated wheel served on a pty by a thread."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml

from rw_ekf.checking.findings import Where
from rw_ekf.drivers.line.wire_map import WireMap, wire_map_from_mapping
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.pty_server import PtyServer
from rw_ekf.drivers.sim.register_server import RegisterServer

MAP_PATH = Path(__file__).parents[2] / "config" / "sunspace-wheel.yaml"


@pytest.fixture(scope="session")
def where() -> Where:
    """A stand-in for file:line:column."""
    return lambda path: "map.yaml:" + ".".join(str(part) for part in path)


@pytest.fixture
def map_data() -> dict[str, Any]:
    """The content of the project's wire map, to be spoilt by a test."""
    data: dict[str, Any] = yaml.safe_load(MAP_PATH.read_text(encoding="utf-8"))
    return data


@pytest.fixture
def wire_map(map_data: dict[str, Any], where: Where) -> WireMap:
    """The project's wire map."""
    return wire_map_from_mapping(map_data, where)


@contextmanager
def _served(
    wire_map: WireMap,
    link_path: Path,
    *,
    speed_factor: float = 1.0,
    initial_speed_rad_s: float = 50.0,
    first_uptime_s: float = 0.0,
) -> Iterator[RegisterServer]:
    """A simulated wheel on a pty; its thread ends, and its link is gone, behind the with block."""
    plant = PlantRunner(PlantParameters(), PlantNoise(0.0), 1, PlantState(speed_rad_s=initial_speed_rad_s))
    registers = RegisterServer(wire_map, plant, serial_number=77, first_uptime_s=first_uptime_s, max_current_A=1.0)
    server = PtyServer(registers, link_path, speed_factor)
    stop = threading.Event()
    thread = threading.Thread(target=server.run, args=(stop.is_set,))
    thread.start()
    try:
        yield registers
    finally:
        stop.set()
        thread.join(5.0)
        server.close()


@pytest.fixture
def served() -> Callable[..., AbstractContextManager[RegisterServer]]:
    """served(wire_map, link_path, ...) serves a wheel for the length of a with block."""
    return _served
