"""Wheels of one design side by side: the population's mean and spread, each wheel drawn towards it, and who is unlike.

A wheel's number theta has the estimate v with the standard deviation s. Of like wheels theta is N(mean, spread^2); with
a small probability a wheel is none of them, and lies anywhere within ten times what is usual. Mean, spread and that
probability are not known: all is averaged over a grid of the three by the likelihood of all wheels, so that few wheels,
whose spread is little more than a guess, accuse nobody. A wheel that is far off hardly widens the spread, for it is
weighed as what it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array

LEAST_WHEELS = 5  # fewer have no spread that could be distinguished from one of them being unlike
_TIMES = 10.0  # as far as an unlike wheel may lie, in usual spreads: chosen; a factor of three moves a threshold by 5 %
_SHARES = (0.01, 0.03, 0.1)  # of wheels that are unlike; before anything is seen ...
_SHARES_BEFORE = (0.70, 0.25, 0.05)  # ... so probable each: chosen, one wheel in fifty on average
_MEANS, _SPREADS = 33, 40  # places of the grid: steps of .3 of the mean's own error, and of some 15 % of a spread
_REACH = 5.0  # of the grid of means: standard errors of a median on either side


@dataclass(eq=False, frozen=True)
class Siblings:
    """n wheels beside each other."""

    mean: float
    mean_std: float  # [1 sigma] of the mean, if nothing moves all wheels alike
    spread: float  # [1 sigma], without the estimates' own errors
    shrunk: Float64Array  # (n,) each wheel's number, drawn towards the mean as far as its own error allows
    shrunk_std: Float64Array  # (n,)
    unlike: Float64Array  # (n,) probability that it is none of this population


def siblings_of(value: Float64Array, std: Float64Array, floor: float) -> Siblings | None:
    """Compare n wheels; floor: a spread below which no difference matters. None where there are fewer than five."""
    if value.size < LEAST_WHEELS:
        return None
    middle, usual = float(np.median(value)), float(np.median(std**2))
    wide = max(1.4826 * float(np.median(np.abs(value - middle))), np.sqrt(usual), floor)
    mean = middle + _REACH * 1.2533 * wide / np.sqrt(value.size) * np.linspace(-1.0, 1.0, _MEANS)
    spread = np.geomspace(floor, max(float(np.ptp(value)), 2.0 * floor), _SPREADS)
    off = (value[:, None, None] - mean[:, None]) ** 2  # (n, means, 1)
    own = spread**2 + std[:, None, None] ** 2  # (n, 1, spreads)
    far = _TIMES**2 * (spread**2 + usual) + std[:, None, None] ** 2
    like, unlike = (-0.5 * (off / width + np.log(width)) for width in (own, far))
    evidence, parts = [], []
    for share, before in zip(_SHARES, _SHARES_BEFORE, strict=True):
        both = np.logaddexp(np.log1p(-share) + like, np.log(share) + unlike)
        evidence.append(both.sum(axis=0) + np.log(before))
        parts.append(np.exp(np.log(share) + unlike - both))
    weights = np.exp(np.array(evidence) - np.max(evidence))
    weights /= weights.sum()
    probability = np.einsum("sab,snab->n", weights, np.array(parts))
    centre = float(np.einsum("sab,a->", weights, mean))
    width = float(np.einsum("sab,b->", weights, spread))
    prior = np.where(probability > 0.5, _TIMES**2, 1.0) * width**2
    pulled = prior / (prior + std**2)
    centre_std = float(np.sqrt(np.einsum("sab,a->", weights, (mean - centre) ** 2)))
    return Siblings(centre, centre_std, width, centre + pulled * (value - centre), np.sqrt(pulled) * std, probability)
