"""What a fitted model leaves, by the usual tests (docs/likelihood.md).

The tests are the usual ones, all at one false-alarm rate: whiteness, mean, NIS, periodogram. They look at the one-step
errors of the whole record's fit, which hide what acts like a bias: the filter follows it. So that they pass says
little; but no verdict says that nothing is left where one of them fails (docs/decisions/0026).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.diagnosis.thresholds import FALSE_ALARM
from rw_ekf.filter.consistency import consistency_of
from rw_ekf.filter.tails import chi_square_tail
from rw_ekf.identify.record_scale import STRIBECK_SHARE_OF_TOP_SPEED
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.friction import FAST_STRIBECK_SPEEDS

# Of each test: a healthy record is accused once in 2,500. Seventy of the proof's healthy wheels have no p below 0.007;
# sensors that fail a test have 2e-5 (noise of two levels) and less, so that a factor of three moves no verdict there.
_SAYS = {
    "ljung_box_p": "it is correlated in time",
    "mean_p": "its mean is not zero",
    "nis_p": "its spread is not the same throughout, as of a sensor that is not always equally good",
    "periodogram_p": "it has a period",
}
_MOST_TESTED = 200_000
_MOST_NEAR = 0.5  # share of the readings that may be left out of the tests


def left_over(fit: Fit) -> Float64Array:
    """What a fit leaves of each reading, whitened (n,); NaN where there is no innovation, and around a break-away.

    There alone it is not Gaussian: a wheel breaks away early or late, and two or three readings show the same miss.
    """
    linearised = fit.linearised
    r, A, _ = linearised.whitened(fit.noise.ratio, fit.noise.variance, linearised.jacobian, linearised.memory_jacobian)
    out = np.full(linearised.chain.reading.size, np.nan)
    out[linearised.innovation_at] = r - A @ fit.likelihood.correction
    near = _near_rest(fit.trajectory.speed, FAST_STRIBECK_SPEEDS * fit.model.stribeck.omega_s)
    near[1:] |= near[:-1].copy()
    out[near] = np.nan
    return out


def _near_rest(speed_rad_s: Float64Array, least_rad_s: float) -> BoolArray:
    """Where a wheel is about to break away, (n,): what turns one way throughout does not but by its slowest end.

    A Stribeck speed that is fitted to a coast-down may be half its top speed: then nothing at all would be tested.
    """
    size = np.abs(speed_rad_s)
    near: BoolArray = size < least_rad_s
    one_way = bool(np.all(speed_rad_s >= 0.0) or np.all(speed_rad_s <= 0.0))
    if one_way and float(np.mean(near)) > _MOST_NEAR:
        near = size < FAST_STRIBECK_SPEEDS * STRIBECK_SHARE_OF_TOP_SPEED * float(np.quantile(size, 0.99))
    return near


def failed_tests(tests: dict[str, Any]) -> dict[str, float]:
    """What `residual_tests` found that noise does not have, in words for each test, with its p; the least first."""
    failed = [(tests[key], words) for key, words in _SAYS.items() if tests[key] is not None]
    return {words: p for p, words in sorted(failed) if p < tests["false_alarm"]}


def residual_tests(white: Float64Array, *, rounded: bool = False) -> dict[str, Any]:
    """p-values for what a fit leaves, whitened (n,), NaN where there is nothing; None where there is too little.

    ljung_box_p: correlation over 20 lags; mean_p; nis_p: the mean square against chi-square, two-sided; periodogram_p:
    the largest peak against all (Fisher's g); false_alarm: the level at which each is called significant. rounded: on a
    grid coarser than the noise; errors of rounding are neither normal nor independent, and no test is made.
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
    if rounded or simple.whiteness_p is None:
        return found | {"ljung_box_p": None, "mean_p": None}
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
