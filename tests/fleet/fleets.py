"""Small simulated fleets for tests, and what a run of one leaves."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from rw_ekf.fleet.fleet_run import FleetRun, run_fleet
from rw_ekf.fleet.folder import FleetFolder, fleet_folder
from rw_ekf.fleet.index import built_index, read_index, write_index
from rw_ekf.fleet.plan import FleetSettings
from rw_ekf.fleet.simulation import FleetShape, write_days


def make_fleet(directory: Path, wheels: int = 3, days: int = 3, **more: Any) -> Path:
    """Write a fleet's logs in this process."""
    directory.mkdir(parents=True, exist_ok=True)
    shape = FleetShape(wheels, days, **{"seed": 4, "lost_share": 0.0, **more})
    for number in range(wheels):
        write_days((str(directory), shape, number, (0, days)))
    return directory


def run_with(executor: Any, directory: Path, settings: FleetSettings | None = None) -> FleetRun:
    """`fleet run` with an executor that is there already, and stays."""
    folder = fleet_folder(directory)
    index = built_index(directory, read_index(folder), keep_gone=True)
    with folder.locked():
        write_index(folder, index)
        return run_fleet(folder, index, settings or FleetSettings(), executor)


def sums_of(folder: FleetFolder) -> dict[str, str]:
    """The checksum of every result, by its place."""
    return {
        str(path.relative_to(folder.results)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.results.rglob("part-*"))
    }


def stamps_of(folder: FleetFolder) -> dict[str, int]:
    """When every result was written [ns], by its place."""
    return {str(path.relative_to(folder.results)): path.stat().st_mtime_ns for path in folder.results.rglob("part-*")}
