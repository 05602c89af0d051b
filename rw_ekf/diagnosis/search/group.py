"""Many regressors taken together, beside all that a model has (docs/diagnosis.md, "The map")."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.search.profiled import Profiled

_RANK = 0.02  # of a unit regressor: less is what the model's own parameters do
_SIGNALS, _SIGNAL_STEPS = (0.3, 300.0), 16  # of random coefficients, of the regressor best seen, in sigmas of noise


@dataclass(frozen=True)
class GroupFit:
    """A regression on many regressors at once, beside all that the model has."""

    statistic: float  # twice the gain in log-likelihood
    freedom: int  # of the combinations that say something
    coefficients: Float64Array  # (m,) the smallest that give the same prediction beside the model's own
    covariance: Float64Array  # (m, m) of as much of them as the record decides


def fit_group(profiled: Profiled, regressors: Float64Array) -> GroupFit:
    """Many regressors (n, m) taken together, those without content left out."""
    independent, mixing = _independent(profiled, regressors)
    count = regressors.shape[1]
    if independent.shape[1] == 0:
        return GroupFit(0.0, 0, np.zeros(count), np.zeros((count, count)))
    best_merit, statistic = -math.inf, 0.0
    solution, covariance = np.zeros(independent.shape[1]), np.zeros((independent.shape[1],) * 2)
    for i in range(len(profiled.ratios)):
        G = profiled.beside_own(i, independent)
        U, sizes, Vt = np.linalg.svd(G, full_matrices=False)
        along = U.T @ profiled.residuals[i]
        gain = float(np.sum(along**2))
        value = float(profiled.value(i, gain))
        merit = float(profiled.restricted(i, gain, sizes.size, float(np.sum(np.log(np.maximum(sizes, 1.0e-300))))))
        if merit > best_merit:
            best_merit, statistic = merit, 2.0 * (value - profiled.without)
            back = Vt.T / np.maximum(sizes, 1.0e-300)
            solution = back @ along
            covariance = max(profiled.rss[i] - gain, 1.0e-9) / profiled.count * (back @ back.T)
    return GroupFit(statistic, independent.shape[1], mixing @ solution, mixing @ covariance @ mixing.T)


def statistics_alone(
    profiled: Profiled, regressors: Float64Array, speed_draws: Float64Array, memory_draws: Float64Array
) -> Float64Array:
    """Statistics (k,) that `fit_group` would give to regressors (n, m) in k records of noise alone.

    speed_draws (n, k), memory_draws: increments that the noises make.
    """
    independent, _ = _independent(profiled, regressors)
    shape = (len(profiled.ratios), speed_draws.shape[1])
    nothing, without, merits, values = (np.full(shape, -math.inf) for _ in range(4))
    for i, ratio in enumerate(profiled.ratios):
        draws = profiled.linearised.whitened(ratio, profiled.variance, speed_draws, memory_draws)[1]
        left = draws - profiled.bases[i] @ (profiled.bases[i].T @ draws)
        U, sizes, _ = np.linalg.svd(profiled.beside_own(i, independent), full_matrices=False)
        lost = profiled.rss[i] - np.sum(left**2, axis=0)  # as if this record's sum of squares had gained so much
        gains = lost + np.sum((U.T @ left) ** 2, axis=0)
        nothing[i], without[i] = profiled.restricted(i, lost, 0, 0.0), profiled.value(i, lost)
        information = float(np.sum(np.log(np.maximum(sizes, 1.0e-300))))
        merits[i], values[i] = profiled.restricted(i, gains, sizes.size, information), profiled.value(i, gains)
    every = np.arange(shape[1])
    found: Float64Array = values[np.argmax(merits, axis=0), every] - without[np.argmax(nothing, axis=0), every]
    return 2.0 * found


def score_random(profiled: Profiled, regressors: Float64Array) -> tuple[float, float]:
    """Statistic of regressors (n, m) whose coefficients are drawn from one normal distribution, and its deviation.

    The coefficients are integrated out, so that their number costs nothing: one number more is fitted, which the
    model without them has at the edge of what it may be. Restricted likelihoods on either side.
    """
    best = nothing = float(profiled.restricted(profiled.own, 0.0, 0, 0.0))
    deviation = 0.0
    for i in range(len(profiled.ratios)):
        U, sizes, _ = np.linalg.svd(profiled.beside_own(i, regressors), full_matrices=False)
        powers = (U.T @ profiled.residuals[i]) ** 2
        for signal in np.geomspace(*_SIGNALS, _SIGNAL_STEPS) / max(float(sizes[0]), 1.0e-300):
            x = (signal * sizes) ** 2
            gain = float(np.sum(powers * x / (1.0 + x)))
            merit = float(profiled.restricted(i, gain, 0, 0.5 * float(np.sum(np.log1p(x)))))
            if merit > best:
                best, deviation = merit, float(signal) * math.sqrt((profiled.rss[i] - gain) / profiled.count)
    return 2.0 * (best - nothing), deviation


def _independent(profiled: Profiled, regressors: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Combinations of regressors (n, m) that say something, of unit length at the model's own ratio.

    With the matrix (m, r) that makes r of them of the regressors; what the model itself follows is in none of them.
    """
    _, A, _ = profiled.linearised.whitened(profiled.ratios[profiled.own], profiled.variance, regressors)
    lengths = np.linalg.norm(A, axis=0)
    seen = lengths > 0.0
    scaled = regressors[:, seen] / lengths[seen]
    _, sizes, Vt = np.linalg.svd(profiled.beside_own(profiled.own, scaled), full_matrices=False)
    combined = Vt[sizes > _RANK].T
    mixing = np.zeros((regressors.shape[1], combined.shape[1]))
    mixing[seen] = combined / lengths[seen, None]
    return np.ascontiguousarray(scaled @ combined), mixing
