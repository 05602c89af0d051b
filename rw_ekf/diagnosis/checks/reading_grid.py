"""The grid that readings stand on, and what rounding to it does to a reading (docs/likelihood.md).

The lattice tests whether the reading stands on a grid coarser than its noise. The evidence is the grid itself and the
likelihood of rounded readings, on both parts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.course.grid import grid_of
from rw_ekf.diagnosis.thresholds import GRID_NOISES

_SAMPLES = 20_000
_LEAST_PROBABILITY = 1.0e-9  # of a cell: beyond it a reading is an outlier of any noise
_LEAST_NOISE = 0.05  # of the grid
_HARMONICS = 20  # of the error's series, more than that much noise leaves anything of


@dataclass(frozen=True)
class Lattice:
    """A grid that the readings stand on, and what a rounded reading explains better than a noisy one."""

    grid_rad_s: float
    noise_rad_s: float  # of the reading before it is rounded
    statistic: float  # 2 x gain in log-likelihood of less noise, then rounded, over all the noise found; fit part
    heldout_statistic: float

    def is_coarser_than(self, variance: float) -> bool:
        """Whether it is coarser than 1.5 sigma of a noise, or an error, of this variance, its own share taken off."""
        return _is_coarse(self.grid_rad_s, variance)


def _is_coarse(grid: float, variance: float) -> bool:
    return grid >= GRID_NOISES * math.sqrt(max(variance - grid * grid / 12.0, 0.0))


def coarse_grid(speed_rad_s: Float64Array, reading_variance: float, least_grid_rad_s: float) -> float | None:
    """The grid [rad/s] of readings (n,), if it is worth comparing likelihoods for."""
    grid = grid_of(speed_rad_s)
    if grid is None or grid < least_grid_rad_s:
        return None
    return grid if _is_coarse(grid, reading_variance) else None


def find_lattice(
    speed_rad_s: Float64Array,
    predicted_rad_s: Float64Array,
    predicted_std_rad_s: Float64Array,
    reading_variance: float,
    heldout: BoolArray,
    least_grid_rad_s: float,
) -> Lattice | None:
    """Compare, given predictions (n,) with standard deviations (n,), rounding of little noise with that of all of it.

    None where there is no grid, one finer than 1.5 sigma of the noise or than least_grid_rad_s: that is a register's
    resolution and does no harm.
    """
    grid = coarse_grid(speed_rad_s, reading_variance, least_grid_rad_s)
    if grid is None:
        return None
    good = np.flatnonzero(np.isfinite(speed_rad_s) & np.isfinite(predicted_rad_s) & np.isfinite(predicted_std_rad_s))
    good = good[:: max(1, good.size // _SAMPLES)]
    held = heldout[good]
    speed, predicted, std = speed_rad_s[good], predicted_rad_s[good], predicted_std_rad_s[good]

    noisy = _log_cell(speed - predicted, np.sqrt(reading_variance + std**2), grid)

    def gains(log_sigma: float) -> Float64Array:
        return _log_cell(speed - predicted, np.hypot(std, math.exp(log_sigma)), grid) - noisy

    from scipy.optimize import minimize_scalar  # takes long to import, and few records get here

    # Where rounding errors are not even over a cell their variance is not g^2/12: all of the noise bounds what is left.
    best = minimize_scalar(
        lambda v: -float(np.sum(gains(v)[~held])),
        bounds=(math.log(_LEAST_NOISE * grid), math.log(max(math.sqrt(reading_variance), 2.0 * _LEAST_NOISE * grid))),
        method="bounded",
    )
    noise = math.exp(float(best.x))
    if grid < GRID_NOISES * noise:
        return None
    found = gains(float(best.x))
    return Lattice(grid, noise, 2.0 * float(np.sum(found[~held])), 2.0 * float(np.sum(found[held])))


def _log_cell(error: Float64Array, spread: Float64Array, grid: float) -> Float64Array:
    """Log-probability that a Gaussian of this spread is rounded to the reading that was read, (n,)."""
    from scipy.special import ndtr

    near = np.abs(error)  # the tail that holds the cell is computed on its own side of zero, where it does not cancel
    cell = ndtr((0.5 * grid - near) / spread) - ndtr((-0.5 * grid - near) / spread)
    found: Float64Array = np.log(np.maximum(cell, _LEAST_PROBABILITY))
    return found


def explained_variance(spread_rad_s: Float64Array, lattice: Lattice) -> Float64Array:
    """Variance [rad^2/s^2], over all places in a cell, of what `rounding_error` gives at speeds known so well (n,).

    Of a speed that is known it is that of the error which all readings there have in common: grid^2/12 of readings
    without noise, and nothing where noise of half the grid makes the mean of many readings the speed.
    """
    blurred = (2.0 * math.pi / lattice.grid_rad_s) ** 2 * (lattice.noise_rad_s**2 + np.square(spread_rad_s))
    series = np.zeros(np.shape(spread_rad_s))
    for k in range(1, _HARMONICS + 1):
        series += np.exp(-blurred * k**2) / k**2
    return series * lattice.grid_rad_s**2 / (2.0 * math.pi**2)


def rounding_error(speed_rad_s: Float64Array, spread_rad_s: Float64Array, lattice: Lattice) -> Float64Array:
    """Expected error of a rounded reading [rad/s] at speeds (n,) known to standard deviations (n,).

    The series of a saw-tooth, each harmonic as much smaller as Gaussian noise before the rounding makes it
    (Widrow & Kollar, Quantization Noise, 2008, ch. 4).
    """
    phase = 2.0 * math.pi * speed_rad_s / lattice.grid_rad_s
    blurred = 2.0 * (math.pi / lattice.grid_rad_s) ** 2 * (lattice.noise_rad_s**2 + spread_rad_s**2)
    error = np.zeros(speed_rad_s.size)
    for k in range(1, _HARMONICS + 1):
        error += (-1.0) ** k / k * np.exp(-blurred * k**2) * np.sin(k * phase)
    return error * lattice.grid_rad_s / math.pi
