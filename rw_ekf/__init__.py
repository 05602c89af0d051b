"""rw_ekf: an online estimator for reaction wheels.

bytes -> drivers -> WheelSample -> model + filter -> Tick -> sinks. See docs/ for the mathematics.

Public is what `dir(rw_ekf)` names, and nothing else: functions and what they return, loaded when first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rw_ekf.version import __version__ as __version__

if TYPE_CHECKING:
    from rw_ekf import fleet
    from rw_ekf.api import (
        Bench,
        Comparison,
        Diagnosis,
        Estimate,
        Estimator,
        Fit,
        GuessedColumns,
        Log,
        Model,
        Run,
        bench,
        compare,
        diagnose,
        fit,
        guess_columns,
        read,
        replay,
        simulate,
    )
    from rw_ekf.errors import RwEkfError as Error

__all__ = [
    "Bench",
    "Comparison",
    "Diagnosis",
    "Error",
    "Estimate",
    "Estimator",
    "Fit",
    "GuessedColumns",
    "Log",
    "Model",
    "Run",
    "bench",
    "compare",
    "diagnose",
    "fit",
    "fleet",
    "guess_columns",
    "read",
    "replay",
    "simulate",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'rw_ekf' has no attribute {name!r}")
    import importlib

    if name == "fleet":
        return importlib.import_module("rw_ekf.fleet")
    return getattr(importlib.import_module("rw_ekf.api"), name)


def __dir__() -> list[str]:
    return sorted(["__version__", *__all__])
