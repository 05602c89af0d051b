"""Is the reading a lattice coarser than its noise? The evidence is the lattice itself and the held-out likelihood."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]

_SAMPLES = 20_000
_ON_LATTICE = 0.999  # share of readings that a grid must hold
_TOLERANCE = 0.01  # of the grid: text with few digits is not exact
_LEAST_VALUES = 5


@dataclass(frozen=True)
class Lattice:
    """A grid that the readings stand on, and what a rounded reading explains better than a noisy one."""

    grid_rad_s: float
    noise_rad_s: float  # of the reading before it is rounded
    statistic: float  # 2 x gain in log-likelihood of rounding over a Gaussian of the same variance, fit part
    heldout_statistic: float


def grid_of(speed_rad_s: Float64Array) -> float | None:
    """The coarsest grid [rad/s] that holds the readings: the common divisor of their differences; None if none does."""
    values = np.unique(np.round(speed_rad_s[np.isfinite(speed_rad_s)][:_SAMPLES], 9))
    if values.size < _LEAST_VALUES:
        return None
    steps = np.diff(values)
    steps = steps[steps > 1.0e-9 * np.max(np.abs(values))]
    if steps.size == 0:
        return None
    grid = float(np.median(steps[steps < 1.5 * np.min(steps)]))
    for divisor in (1.0, 2.0, 3.0, 4.0, 5.0):
        tried = grid / divisor
        turns = np.round(speed_rad_s[np.isfinite(speed_rad_s)][:_SAMPLES] / tried)
        refined = _refined(speed_rad_s, tried, turns)
        off = np.abs(speed_rad_s[np.isfinite(speed_rad_s)][:_SAMPLES] / refined - turns)
        if np.mean(off < _TOLERANCE) >= _ON_LATTICE:
            return refined
    return None


def _refined(speed_rad_s: Float64Array, grid: float, turns: Float64Array) -> float:
    values = speed_rad_s[np.isfinite(speed_rad_s)][:_SAMPLES]
    power = float(turns @ turns)
    return float(values @ turns) / power if power > 0.0 else grid


def find_lattice(
    speed_rad_s: Float64Array,
    predicted_rad_s: Float64Array,
    predicted_std_rad_s: Float64Array,
    reading_variance: float,
    heldout: NDArray[np.bool_],
) -> Lattice | None:
    """Compare, given predictions (n,) with standard deviations (n,), a rounded reading with a Gaussian one.

    None where there is no grid, or one finer than the noise: that is a register's resolution and does no harm.
    """
    grid = grid_of(speed_rad_s)
    if grid is None:
        return None
    inner = max(reading_variance - grid * grid / 12.0, (0.02 * grid) ** 2)
    noise = math.sqrt(inner)
    if grid <= noise:
        return None
    good = np.isfinite(speed_rad_s) & np.isfinite(predicted_rad_s) & np.isfinite(predicted_std_rad_s)
    best, statistic, heldout_statistic = noise, -math.inf, -math.inf
    for share in (0.25, 0.5, 1.0, 1.5):
        tried = noise * share
        gain = _gains(
            speed_rad_s,
            predicted_rad_s,
            np.hypot(predicted_std_rad_s, tried),
            grid,
            reading_variance,
            predicted_std_rad_s,
        )
        found = 2.0 * float(np.sum(gain[good & ~heldout]))
        if found > statistic:
            best, statistic = tried, found
            heldout_statistic = 2.0 * float(np.sum(gain[good & heldout]))
    return Lattice(grid, best, statistic, heldout_statistic)


def _gains(
    speed: Float64Array,
    predicted: Float64Array,
    spread: Float64Array,
    grid: float,
    variance: float,
    predicted_std: Float64Array,
) -> Float64Array:
    """Log-probability of the cell under rounding less that under a Gaussian density times the cell, (n,)."""
    from scipy.special import ndtr

    high = (speed + 0.5 * grid - predicted) / spread
    low = (speed - 0.5 * grid - predicted) / spread
    cell = np.maximum(ndtr(-low) - ndtr(-high), 1.0e-12)
    cell = np.maximum(cell, ndtr(high) - ndtr(low))
    total = variance + predicted_std**2
    gaussian = grid * np.exp(-0.5 * (speed - predicted) ** 2 / total) / np.sqrt(2.0 * math.pi * total)
    found: Float64Array = np.log(cell) - np.log(np.maximum(gaussian, 1.0e-12))
    return found
