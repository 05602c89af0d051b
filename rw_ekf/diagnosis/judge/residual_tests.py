"""Tests of a model's residual, each with its false-alarm rate: whiteness, mean, NIS, periodogram (docs/diagnosis.md).

They look at one-step errors of the frozen filter, which hide what acts like a bias: the filter follows it. So none of
them decides; the likelihood and the map do. They are what a reader expects to see, and say so when they disagree.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.filter.consistency import chi_square_tail, consistency_of

FALSE_ALARM = 1.0e-3  # of each test
_MOST = 200_000


def residual_tests(normalised_innovation: Float64Array) -> dict[str, Any]:
    """p-values for normalised innovations (n,), NaN where there is none; None where there are too few.

    ljung_box_p: correlation over 20 lags; mean_p; nis_p: the mean square against chi-square, two-sided; periodogram_p:
    the largest peak against all (Fisher's g); false_alarm: the level at which each is called significant.
    """
    z = normalised_innovation[np.isfinite(normalised_innovation)][:_MOST]
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
