"""Wheels of one design side by side: the population's mean and spread, each wheel drawn towards it, and who is unlike.

A wheel's number theta has the estimate v with the standard deviation s. Of like wheels theta is N(mean, spread^2); with
a small probability a wheel is none of them, and lies anywhere within ten times what is usual. Mean, spread and that
probability come from all wheels (empirical Bayes, by expectation and maximisation); a wheel that is far off hardly
widens them, for it is weighed as what it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array

LEAST_WHEELS = 5  # fewer have no spread that could be told from one of them being unlike
_TIMES = 10.0  # as far as an unlike wheel may lie, in usual spreads: chosen; a factor of three moves a threshold by 5 %
_UNLIKE, _WHEELS_BEFORE = 0.02, 50.0  # before anything is seen: one in fifty, as much worth as so many wheels
_ROUNDS = 200
_SAME = 1e-9


@dataclass(frozen=True)
class Siblings:
    """n wheels beside each other."""

    mean: float
    spread: float  # [1 sigma], without the estimates' own errors
    shrunk: Float64Array  # (n,) each wheel's number, drawn towards the mean as far as its own error allows
    shrunk_std: Float64Array  # (n,)
    unlike: Float64Array  # (n,) probability that it is none of this population


def siblings_of(value: Float64Array, std: Float64Array, floor: float) -> Siblings | None:
    """Compare n wheels; floor: a spread below which no difference matters. None where there are fewer than five."""
    if value.size < LEAST_WHEELS:
        return None
    mean = float(np.median(value))
    wide = 1.4826 * float(np.median(np.abs(value - mean)))
    spread = max(np.sqrt(max(wide**2 - float(np.median(std**2)), 0.0)), floor)
    share = _UNLIKE
    unlike = np.zeros_like(value)
    for _ in range(_ROUNDS):
        own = spread**2 + std**2
        far = _TIMES**2 * (spread**2 + float(np.median(std**2))) + std**2
        odds = np.log(share / (1.0 - share)) + 0.5 * (value - mean) ** 2 * (1.0 / own - 1.0 / far)
        odds -= 0.5 * np.log(far / own)
        unlike = 1.0 / (1.0 + np.exp(-np.clip(odds, -700.0, 700.0)))
        like = 1.0 - unlike
        new_mean = float(np.sum(like / own * value) / np.sum(like / own))
        drawn = new_mean + spread**2 / own * (value - new_mean)
        left = spread**2 * std**2 / own
        new_spread = max(float(np.sqrt(np.sum(like * ((drawn - new_mean) ** 2 + left)) / np.sum(like))), floor)
        share = float((unlike.sum() + _UNLIKE * _WHEELS_BEFORE) / (value.size + _WHEELS_BEFORE))
        moved = abs(new_mean - mean) + abs(new_spread - spread)
        mean, spread = new_mean, new_spread
        if moved < _SAME * (abs(mean) + spread):
            break
    prior = np.where(unlike > 0.5, _TIMES**2, 1.0) * spread**2
    pulled = prior / (prior + std**2)
    return Siblings(mean, float(spread), mean + pulled * (value - mean), np.sqrt(pulled) * std, unlike)
