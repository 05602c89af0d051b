"""What a fitted model leaves, by the usual tests (docs/diagnosis.md).

The tests are the usual ones, each at its own false-alarm rate: whiteness, mean, NIS, periodogram. They look at one-step
errors of the whole record's fit, which hide what acts like a bias: the filter follows it. So none of them decides; they
are what a reader expects to see, and say so when they disagree.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.filter.consistency import consistency_of
from rw_ekf.filter.tails import chi_square_tail
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.friction import FAST_STRIBECK_SPEEDS

FALSE_ALARM = 1.0e-3  # of each test
_MOST_TESTED = 200_000


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
