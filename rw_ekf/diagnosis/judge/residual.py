"""What a fitted model leaves, by the usual tests, and the grid that readings stand on (docs/diagnosis.md).

The tests are the usual ones, each at its own false-alarm rate: whiteness, mean, NIS, periodogram. They look at one-step
errors of the whole record's fit, which hide what acts like a bias: the filter follows it. So none of them decides; they
are what a reader expects to see, and say so when they disagree.

The lattice asks whether the reading stands on a grid coarser than its noise. The evidence is the grid itself and the
held-out likelihood.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.course.grid import grid_of
from rw_ekf.filter.consistency import chi_square_tail, consistency_of
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.friction import FAST_STRIBECK_SPEEDS

FALSE_ALARM = 1.0e-3  # of each test
_MOST_TESTED = 200_000
_SAMPLES = 20_000
_LEAST_PROBABILITY = 1.0e-9  # of a cell: beyond it a reading is an outlier of any noise
_COARSER = 1.5  # standard deviations of the noise that a grid must exceed


def left_over(fit: Fit) -> Float64Array:
    """What a fit leaves of each reading, whitened (n,); NaN where there is no innovation, and around a break-away.

    There alone it is not Gaussian: a wheel breaks away early or late, and two or three readings show the same miss.
    """
    linearised = fit.linearised
    r, A, _ = linearised.whitened(fit.noise.ratio, fit.noise.variance, linearised.jacobian, linearised.memory_jacobian)
    out = np.full(linearised.chain.reading.size, np.nan)
    out[linearised.innovation_at] = r - A @ fit.likelihood.correction
    near = np.abs(fit.trajectory.speed) < FAST_STRIBECK_SPEEDS * fit.model.stribeck.omega_s
    near[1:] |= near[:-1].copy()
    out[near] = np.nan
    return out


def residual_tests(white: Float64Array) -> dict[str, Any]:
    """p-values for what a fit leaves, whitened (n,), NaN where there is nothing; None where there is too little.

    ljung_box_p: correlation over 20 lags; mean_p; nis_p: the mean square against chi-square, two-sided; periodogram_p:
    the largest peak against all (Fisher's g); false_alarm: the level at which each is called significant.
    """
    z = white[np.isfinite(white)][:_MOST_TESTED]
    simple = consistency_of(z, np.ones(z.size), np.ones(z.size, dtype=bool))
    found: dict[str, Any] = {
        "samples": int(z.size),
        "ljung_box_p": simple.whiteness_p,
        "mean_p": simple.mean_p,
        "nis_p": None,
        "periodogram_p": None,
        "false_alarm": FALSE_ALARM,
    }
    if simple.whiteness_p is None:
        return found
    tail = chi_square_tail(float(z @ z), z.size)
    found["nis_p"] = 2.0 * min(tail, 1.0 - tail)
    power = np.abs(np.fft.rfft(z - z.mean())[1:]) ** 2
    share = float(power.max() / power.sum())
    found["periodogram_p"] = fisher_g_tail(share, power.size)
    return found


def fisher_g_tail(share: float, count: int) -> float:
    """P(the largest of `count` periodogram ordinates holds more than this share of all), white noise [Fisher 1929]."""
    first = math.log(count) + (count - 1) * math.log1p(-share) if share < 1.0 else -math.inf
    return min(1.0, math.exp(min(first, 0.0)))


@dataclass(frozen=True)
class Lattice:
    """A grid that the readings stand on, and what a rounded reading explains better than a noisy one."""

    grid_rad_s: float
    noise_rad_s: float  # of the reading before it is rounded
    statistic: float  # 2 x gain in log-likelihood of less noise, then rounded, over all the noise found; fit part
    heldout_statistic: float


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
    grid = grid_of(speed_rad_s)
    if grid is None:
        return None
    inner = max(reading_variance - grid * grid / 12.0, (0.02 * grid) ** 2)
    noise = math.sqrt(inner)
    if grid < least_grid_rad_s or grid < _COARSER * noise:
        return None
    good = np.flatnonzero(np.isfinite(speed_rad_s) & np.isfinite(predicted_rad_s) & np.isfinite(predicted_std_rad_s))
    good = good[:: max(1, good.size // _SAMPLES)]
    held = heldout[good]
    speed, predicted, std = speed_rad_s[good], predicted_rad_s[good], predicted_std_rad_s[good]

    noisy = _log_cell(speed - predicted, np.sqrt(reading_variance + std**2), grid)

    def gains(log_sigma: float) -> Float64Array:
        return _log_cell(speed - predicted, np.hypot(std, math.exp(log_sigma)), grid) - noisy

    from scipy.optimize import minimize_scalar  # takes long to import, and few records get here

    best = minimize_scalar(
        lambda v: -float(np.sum(gains(v)[~held])),
        bounds=(math.log(0.05 * grid), math.log(max(1.5 * noise, 0.1 * grid))),
        method="bounded",
    )
    found = gains(float(best.x))
    return Lattice(grid, math.exp(float(best.x)), 2.0 * float(np.sum(found[~held])), 2.0 * float(np.sum(found[held])))


def _log_cell(error: Float64Array, spread: Float64Array, grid: float) -> Float64Array:
    """Log-probability that a Gaussian of this spread is rounded to the reading that was read, (n,)."""
    from scipy.special import ndtr

    near = np.abs(error)  # the tail that holds the cell is computed on its own side of zero, where it does not cancel
    cell = ndtr((0.5 * grid - near) / spread) - ndtr((-0.5 * grid - near) / spread)
    found: Float64Array = np.log(np.maximum(cell, _LEAST_PROBABILITY))
    return found
