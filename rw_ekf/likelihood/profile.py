"""The likelihood of a model along a trajectory with the noises profiled out (docs/likelihood.md).

The noises are never known beforehand, and a model that lacks something pays in process noise. So every comparison of
models is between likelihoods each at its own best ratio of noises, q dt / R; R itself drops out in closed form.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.filter.belief import Belief
from rw_ekf.likelihood.linearisation import Linearisation, Noise
from rw_ekf.likelihood.model_vector import prior_rows

# Of q dt to R: over a record of 10^5 samples the speed then wanders by a tenth of a reading's noise.
LEAST_RATIO = 1.0e-7
MOST_RATIO = 1.0e2
_FIRST_STEP, _NEAR, _NARROW = 0.8, 0.05, 2.0  # of the logarithm of the ratio
_PARABOLAS = 5
_LITTLE = 0.5  # log-likelihood that a correction gains: the noises beside it are then those without it
Rows = tuple[Float64Array, Float64Array]  # of an a priori, as `prior_rows` gives them


@dataclass(eq=False, frozen=True)
class Likelihood:
    """Of one model, at its best noises and corrections of its vector; what is known of the torque noise counts."""

    value: float
    restricted: float  # with the vector and R integrated out (REML, eq. 6a): decides on noises
    noise: Noise
    correction: Float64Array
    covariance: Float64Array
    count: int


def likelihood(linearised: Linearisation, prior: Belief | None, noise: Noise) -> Likelihood:
    """Maximise over corrections of the vector, R and the ratio of noises; start from `noise`.

    The ratio is that of the highest restricted likelihood (eq. 6a): a wandering speed that the
    vector can follow would otherwise pass for one that wanders less.
    """
    known = None if prior is None else prior_rows(prior, linearised.model)
    at_one = partial(at_ratio, linearised, known, noise.variance)
    return _at_best_ratio(at_one, noise)


def _at_best_ratio(at_one: Callable[[float], Likelihood], noise: Noise) -> Likelihood:
    """Of the likelihoods at ratios of noises the one of the highest restricted likelihood, sought from `noise`."""
    found: dict[float, Likelihood] = {}

    def at(log_ratio: float) -> float:
        if log_ratio not in found:
            found[log_ratio] = at_one(math.exp(log_ratio))
        return found[log_ratio].restricted

    low, high = math.log(LEAST_RATIO), math.log(MOST_RATIO)
    at(low)
    _climb(at, min(max(math.log(noise.ratio), low), high), low, high)
    return max(found.values(), key=lambda item: item.restricted)


def _climb(at: Callable[[float], float], x: float, low: float, high: float) -> None:
    """Evaluate a smooth function ever nearer to its top, from x: uphill by growing steps, then by parabolas."""
    step = _FIRST_STEP
    left, right = max(x - step, low), min(x + step, high)
    while max(at(left), at(right)) > at(x):
        x, step = (left if at(left) > at(right) else right), 2.0 * step
        left, right = max(x - step, low), min(x + step, high)
    for _ in range(_PARABOLAS):
        if x in (left, right):  # the top is at a bound
            return
        one, two = (x - left) * (at(x) - at(right)), (x - right) * (at(x) - at(left))
        if one == two:
            return
        tip = x - 0.5 * ((x - left) * one - (x - right) * two) / (one - two)
        if not left < tip < right or abs(tip - x) < _NEAR:
            if right - left < _NARROW:
                return
            tip = 0.5 * (x + (left if x - left > right - x else right))
        if at(tip) > at(x):
            left, right = (left, x) if tip < x else (x, right)
            x = tip
        else:
            left, right = (tip, right) if tip < x else (left, tip)


def at_ratio(
    linearised: Linearisation, known: Rows | None, scale: float, ratio: float, *, corrected: bool = True
) -> Likelihood:
    """Maximise over corrections of the vector and R at one ratio of noises; scale: about what R is [rad^2/s^2].

    corrected: False for the model as it stands.
    """
    sums, logs, n = linearised.whitened_sums(ratio, scale, linearised.jacobian, linearised.memory_jacobian)
    gram, square = sums[:-1, :-1], float(sums[-1, -1])
    size = gram.shape[0]
    if not (math.isfinite(logs) and np.isfinite(sums).all()):  # numbers that blow up explain nothing
        return Likelihood(-math.inf, -math.inf, Noise(scale, ratio), np.zeros(size), np.eye(size), n)
    if size == 0:
        variance = max(square, 1.0e-12) / max(n, 1)
        value = -0.5 * (n * math.log(variance) + logs + n) + float(noise_term(linearised, scale * variance, ratio))
        return Likelihood(value, value, Noise(variance * scale, ratio), np.zeros(0), np.zeros((0, 0)), n)
    weights = np.sqrt(np.diag(gram))
    weights[weights == 0.0] = 1.0
    normal, target = gram / np.outer(weights, weights), sums[-1, :-1] / weights
    pull, offset = np.zeros((size, size)), np.zeros(size)
    if known is not None:
        W, aim = known
        pull, offset = W.T @ W, W.T @ (aim - W @ linearised.model.vector)
    # r is in units of sqrt(scale); the prior counts as it is, which is as weak as it should be.
    total = normal + pull / np.outer(weights, weights) + 1.0e-12 * np.eye(size)
    step = np.linalg.solve(total, target + offset / weights) if corrected else np.zeros(size)
    rss = float(square - 2.0 * step @ target + step @ normal @ step)
    rss = max(rss, 1.0e-12)
    variance = rss / max(n, 1)  # in units of scale
    value = -0.5 * (n * math.log(variance) + logs + n) + float(noise_term(linearised, scale * variance, ratio))
    covariance = variance * np.linalg.inv(total) / np.outer(weights, weights)
    information = 0.5 * float(np.linalg.slogdet(total)[1]) + float(np.sum(np.log(weights)))  # half its log-determinant
    restricted = value - information + 0.5 * size * math.log(variance)
    return Likelihood(value, restricted, Noise(variance * scale, ratio), step / weights, covariance, n)


def noise_term(linearised: Linearisation, variance: float | Float64Array, ratio: float) -> Float64Array:
    """What is known beforehand of the noises, at R = variance (any shape) and this ratio: a log-density, or 0.

    Of the torque's, if anything. And that readings on a grid are no better than the grid: to a Gaussian density a
    reading that stands still is as good as certain, so that it would rather have a wheel that jumps from cell to cell.
    """
    record = linearised.record
    known, least = record.torque_noise, record.least_variance
    term = np.zeros(np.shape(variance)) if known is None else known.log_density(ratio * variance / record.period_s)
    if least > 0.0:
        term = term - linearised.innovation_at.size * np.log(np.maximum(least / variance, 1.0))
    return term


def value_of(linearised: Linearisation, noise: Noise) -> Likelihood:
    """Likelihood of the model as it stands, nothing corrected, at a given ratio of noises."""
    bare = replace(linearised, jacobian=linearised.jacobian[:, :0], memory_jacobian=linearised.memory_jacobian[:, :0])
    return at_ratio(bare, None, noise.variance, noise.ratio)


def uncorrected(linearised: Linearisation, noise: Noise, prior: Belief | None = None) -> Likelihood:
    """Likelihood of the model as it stands, nothing corrected, at its own best noises; sought from `noise`."""
    known = None if prior is None else prior_rows(prior, linearised.model)
    return _at_best_ratio(partial(at_ratio, linearised, known, noise.variance, corrected=False), noise)


def as_it_stands(linearised: Linearisation, prior: Belief | None, corrected: Likelihood) -> Likelihood:
    """Likelihood of the model without the correction that `likelihood` found, at its own best noises.

    A model that is still far off needs more torque noise than the corrected one. At the noises of that one it looks
    the worse the more there is to gain, so that a step in the right direction would pass for a loss.
    """
    here = value_of(linearised, corrected.noise)
    if corrected.value - here.value > _LITTLE:
        here = uncorrected(linearised, corrected.noise, prior)
    return replace(here, covariance=corrected.covariance, correction=corrected.correction)
