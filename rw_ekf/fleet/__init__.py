"""Many wheels over years: `build`, `run`, `diagnose`, `trends` and `view` of a directory of logs (docs/fleet.md).

Loaded when first used, as all of `rw_ekf`: `rw_ekf.fleet.run("logs").text()`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rw_ekf.fleet.fleet_api import (
        Diagnoses,
        FleetIndex,
        FleetRun,
        Trends,
        build,
        diagnose,
        run,
        simulate,
        trends,
        view,
    )

__all__ = ["Diagnoses", "FleetIndex", "FleetRun", "Trends", "build", "diagnose", "run", "simulate", "trends", "view"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'rw_ekf.fleet' has no attribute {name!r}")
    import importlib

    return getattr(importlib.import_module("rw_ekf.fleet.fleet_api"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
