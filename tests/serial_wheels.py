"""A wheel on a serial line, and one that is simulated, of a wire map alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rw_ekf.clock import Clock
from rw_ekf.drivers.line.register_protocol import RegisterProtocol
from rw_ekf.drivers.line.serial_port import open_serial_port
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.drivers.line.shared_port import OpenPort
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.drivers.sim.plant_parameters import PlantParameters


def open_serial_wheel(
    port: str, wire_map: WireMap, clock: Clock, timeout_s: float, *, open_port: OpenPort = open_serial_port,
    **options: Any,
) -> SerialWheel:  # fmt: skip
    """Open a wheel that the map describes; options as `RegisterProtocol.open_wheel` has them."""
    wheel = RegisterProtocol(wire_map, open_port=open_port).open_wheel(port, clock, timeout_s, **options)
    assert isinstance(wheel, SerialWheel)
    return wheel


def serve_simulated_wheel(wire_map: WireMap, plant: PlantParameters, link_path: str | Path, **options: Any) -> None:
    """Serve one; options as `RegisterProtocol.serve` has them."""
    RegisterProtocol(wire_map).serve(plant, link_path, **options)
