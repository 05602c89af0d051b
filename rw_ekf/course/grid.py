"""The grid that rounded readings stand on: of a register, a display, or a counter with few counts."""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import Float64Array

_SAMPLES = 20_000
_ON_LATTICE = 0.999  # share of readings that a grid must hold
_TOLERANCE = 0.01  # of the grid: text with few digits is not exact
_LEAST_VALUES = 5


def grid_of(speed_rad_s: Float64Array) -> float | None:
    """The coarsest grid [rad/s] that holds the readings: the common divisor of their differences; None if none does."""
    read = speed_rad_s[np.isfinite(speed_rad_s)][:_SAMPLES]
    values = np.unique(np.round(read, 9))
    if values.size < _LEAST_VALUES:
        return None
    steps = np.diff(values)
    steps = steps[steps > 1.0e-9 * np.max(np.abs(values))]
    if steps.size == 0:
        return None
    grid = float(np.median(steps[steps < 1.5 * np.min(steps)]))
    for divisor in (1.0, 2.0, 3.0, 4.0, 5.0):
        turns = np.round(read / (grid / divisor))
        power = float(turns @ turns)
        refined = float(read @ turns) / power if power > 0.0 else grid / divisor
        if np.mean(np.abs(read / refined - turns) < _TOLERANCE) >= _ON_LATTICE:
            return refined
    return None
