"""Many regressors taken together, beside all that a model has (docs/likelihood.md, "The map")."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.hypotheses.noise_ratios import Profiled

_RANK = 0.02  # of a unit regressor: less is what the model's own parameters do
_SINGULAR = 1.0e-12  # of the largest square: less is rounding
_SIGNALS, _SIGNAL_STEPS = (0.3, 300.0), 16  # of random coefficients, of the regressor best seen, in sigmas of noise
_GREATEST = 3000.0  # where every size is weighed


@dataclass(eq=False, frozen=True)
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
        _, gram, products = profiled.sums(i, independent)
        back, information = _inverse_root(gram)
        along = back.T @ products
        gain = float(along @ along)
        value = float(profiled.value(i, gain))
        merit = float(profiled.restricted(i, gain, along.size, information))
        if merit > best_merit:
            best_merit, statistic = merit, 2.0 * (value - profiled.without)
            solution = back @ along
            covariance = max(profiled.rss[i] - gain, 1.0e-9) / profiled.count * (back @ back.T)
    return GroupFit(statistic, independent.shape[1], mixing @ solution, mixing @ covariance @ mixing.T)


def statistics_alone(
    profiled: Profiled, groups: list[Float64Array], speed_draws: Float64Array, memory_draws: Float64Array
) -> Float64Array:
    """Statistics (g, k) that `fit_group` would give to groups of regressors (n, m) in k records of noise alone.

    speed_draws (n, k), memory_draws: increments that the noises make.
    """
    independent = [_independent(profiled, regressors)[0] for regressors in groups]
    shape = (len(profiled.ratios), speed_draws.shape[1])
    nothing, without = np.empty(shape), np.empty(shape)
    merits, values = np.empty((len(groups), *shape)), np.empty((len(groups), *shape))
    for i, ratio in enumerate(profiled.ratios):
        draws = profiled.linearised.whitened(ratio, profiled.variance, speed_draws, memory_draws)[1]
        left = draws - profiled.bases[i] @ (profiled.bases[i].T @ draws)
        lost = profiled.rss[i] - np.sum(left**2, axis=0)  # as if this record's sum of squares had gained so much
        nothing[i], without[i] = profiled.restricted(i, lost, 0, 0.0), profiled.value(i, lost)
        for g, regressors in enumerate(independent):
            G = profiled.beside_own(i, regressors)
            back, information = _inverse_root(G.T @ G)
            gains = lost + np.sum((back.T @ (G.T @ left)) ** 2, axis=0)
            merits[g, i] = profiled.restricted(i, gains, back.shape[1], information)
            values[g, i] = profiled.value(i, gains)
    alone = np.take_along_axis(without, np.argmax(nothing, axis=0)[None], axis=0)[0]
    found = np.take_along_axis(values, np.argmax(merits, axis=1)[:, None], axis=1)[:, 0]
    gained: Float64Array = 2.0 * (found - alone)
    return gained


def score_random(profiled: Profiled, regressors: Float64Array) -> tuple[float, float]:
    """Statistic of regressors (n, m) whose coefficients are drawn from one normal distribution, and its deviation.

    The coefficients are integrated out, so that their number costs nothing: one number more is fitted, which the
    model without them has at the edge of what it may be. Restricted likelihoods on either side.
    """
    best = nothing = float(profiled.restricted(profiled.own, 0.0, 0, 0.0))
    deviation = 0.0
    signals = np.geomspace(*_SIGNALS, _SIGNAL_STEPS)
    for i in range(len(profiled.ratios)):
        sums = profiled.sums(i, regressors)
        gains, merits, unit = _drawn(profiled, i, sums.gram, sums.products, signals)
        at = int(np.argmax(merits))
        if merits[at] > best:
            best = float(merits[at])
            deviation = float(signals[at]) / unit * math.sqrt((profiled.rss[i] - gains[at]) / profiled.count)
    return 2.0 * (best - nothing), deviation


def evidence_of_random(profiled: Profiled, regressors: Float64Array) -> float:
    """Log of how much likelier a record is with regressors (n, m) of such coefficients, everything integrated out.

    Their size is anybody's guess from what is not seen at all upwards; noises have the prior of eq. 6b.
    """
    sums = [profiled.sums(i, regressors) for i in range(len(profiled.ratios))]
    return evidence_of_drawn(profiled, [(one.gram, one.products) for one in sums])[0]


def evidence_of_drawn(profiled: Profiled, sums: Sequence[tuple[Float64Array, Float64Array]]) -> tuple[float, float]:
    """The same from gram (m, m) and products (m,) at each ratio, and the likeliest deviation of the coefficients."""
    signals = np.geomspace(_SIGNALS[0], _GREATEST, _SIGNAL_STEPS)
    logs = np.log(np.array(profiled.ratios))
    spacing = np.log(np.gradient(logs) if logs.size > 1 else np.ones(1))
    without, merits = np.empty(logs.size), np.empty((logs.size, signals.size))
    deviations = np.empty(merits.shape)
    for i in range(logs.size):
        gains, found, unit = _drawn(profiled, i, *sums[i], signals)
        deviations[i] = signals / unit * np.sqrt(profiled.left(i, gains))
        flat = spacing[i] + 0.5 * logs[i]  # in sqrt(q), as far as nothing is known
        without[i] = profiled.restricted(i, 0.0, 0, 0.0) + flat + 0.5 * np.log(profiled.left(i, 0.0))
        merits[i] = found + flat + 0.5 * np.log(profiled.left(i, gains))
    factor = np.logaddexp.reduce(merits, axis=None) - math.log(signals.size) - np.logaddexp.reduce(without)
    return float(factor), float(deviations.ravel()[np.argmax(merits)])


def _drawn(
    profiled: Profiled, i: int, gram: Float64Array, products: Float64Array, signals: Float64Array
) -> tuple[Float64Array, Float64Array, float]:
    """Gains and restricted log-likelihoods (k,) at the i-th ratio of regressors whose coefficients are drawn.

    gram (m, m), products (m,): of the regressors beside the model's own. signals (k,): deviations of the coefficients
    times the length of the regressor best seen, which comes third.
    """
    squares, V = np.linalg.eigh(gram)
    squares, unit = np.maximum(squares, 0.0), math.sqrt(max(float(squares[-1]), 1.0e-300))
    scale = (signals[:, None] / unit) ** 2
    known = 1.0 + scale * squares  # what the data know of each combination, to what is known beforehand
    gains: Float64Array = np.sum((V.T @ products) ** 2 * scale / known, axis=1)
    return gains, profiled.restricted(i, gains, 0, 0.5 * np.sum(np.log(known), axis=1)), unit


def _inverse_root(gram: Float64Array) -> tuple[Float64Array, float]:
    """B (m, r) with B B' the inverse of a Gram matrix (m, m), and half its log-determinant."""
    squares, V = np.linalg.eigh(gram)
    kept = squares > _SINGULAR * np.max(squares, initial=1.0e-300)
    return V[:, kept] / np.sqrt(squares[kept]), 0.5 * float(np.sum(np.log(squares[kept])))


def _independent(profiled: Profiled, regressors: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Combinations of regressors (n, m) that say something, of unit length at the model's own ratio.

    With the matrix (m, r) that makes r of them of the regressors; what the model itself follows is in none of them.
    """
    whole, gram, _ = profiled.sums(profiled.own, regressors)
    seen = whole > 0.0
    lengths = np.sqrt(whole[seen])
    squares, V = np.linalg.eigh(gram[np.ix_(seen, seen)] / np.outer(lengths, lengths))
    combined = V[:, squares > _RANK**2]
    mixing = np.zeros((regressors.shape[1], combined.shape[1]))
    mixing[seen] = combined / lengths[:, None]
    return regressors @ mixing, mixing
