"""A fit with the noises integrated out: what is not known of the process noise is in the parameters' sigmas.

The restricted likelihood L(rho) of the ratio rho = q dt / R (docs/likelihood.md eq. 6a) is, but for a constant, that of
the readings with parameters and R integrated out [Patterson & Thompson 1971]. With a prior flat in q^(1/4), half-way
between flat in the torque noise sqrt(q) [Gelman 2006] and flat in its logarithm, which would put all weight at zero,

    w(rho) ~ L(rho) rho^(1/4) d log rho,   mean = sum w m(rho),   cov = sum w [C(rho) + (m(rho) - mean)(...)'].

"No process noise can be seen" then means a wide distribution below some limit, not the number 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.linearisation import Linearisation, Noise
from rw_ekf.likelihood.model_vector import prior_rows
from rw_ekf.likelihood.profile import LEAST_RATIO, MOST_RATIO, Likelihood, Rows, at_ratio

# Any power above 0 is proper at zero. At 1/2 (flat in sqrt(q)) sigmas are too wide where there is little torque noise,
# and below 1/4 too narrow where there is some: docs/decisions/0020.
_PRIOR_POWER = 0.25
_STEP = 0.4  # of log ratio between two points of the grid
_DROP = 9.0  # log-likelihood below the top where the grid ends
_MIDDLES = (0.1, 0.3, 0.5, 0.7, 0.9)  # of fifths of the distribution
_SEEN = 1.35  # half the 90 % quantile of chi-square(1): at the boundary zero only one side is left


@dataclass(eq=False, frozen=True)
class NoisePosterior:
    """Noises and the model's vector, the ratio of noises integrated out."""

    correction: Float64Array  # (p,) of the vector
    covariance: Float64Array  # (p, p)
    speed_noise_rad_s: float  # square root of the mean R
    speed_noise_std: float
    acceleration_noise: float  # square root of the mean q: what a filter should be given [rad/s per sqrt(s)]
    acceleration_noise_std: float
    acceleration_noise_limit: float  # 95 % of the distribution lies below
    acceleration_noise_quantiles: Float64Array  # (5,) at 0.1, 0.3 ... 0.9: of equal weight
    acceleration_noise_seen: bool  # zero is outside 95 % of the distribution: the data call for some
    log_evidence: float  # of the model on this linearised: log of the sum of L over the grid


def noise_posterior(fit: Fit) -> NoisePosterior:
    """Integrate over the ratio of noises, on a grid around the top of its distribution, along a fit's trajectory."""
    linearised, noise = fit.linearised, fit.noise
    known = None if fit.prior is None else prior_rows(fit.prior, fit.model)
    points = _grid(linearised, known, noise)
    logs = np.array([_density(item) for item in points])
    weights = np.exp(logs - logs.max())
    total = float(weights.sum())
    weights /= total
    ratios = np.array([item.noise.ratio for item in points])
    variances = np.array([item.noise.variance for item in points])
    densities = ratios * variances / linearised.record.period_s  # q
    mean = np.einsum("i,ij->j", weights, np.array([item.correction for item in points]))
    covariance = np.zeros((mean.size, mean.size))
    for weight, item in zip(weights, points, strict=True):
        off = item.correction - mean
        covariance += weight * (item.covariance + np.outer(off, off))
    sigma = math.sqrt(float(weights @ variances))
    deviation = np.sqrt(densities)
    centre = float(weights @ deviation)
    within = float(weights @ (variances - sigma**2) ** 2)  # of R between the ratios; within each, R's own chi-square
    own = 2.0 * sigma**4 / max(points[0].count, 1)
    limit = float(np.interp(0.95, np.cumsum(weights), deviation))
    without = at_ratio(linearised, known, noise.variance, LEAST_RATIO).restricted
    return NoisePosterior(
        correction=mean,
        covariance=covariance,
        speed_noise_rad_s=sigma,
        speed_noise_std=0.5 * math.sqrt(within + own) / sigma,
        acceleration_noise=math.sqrt(float(weights @ densities)),
        acceleration_noise_std=math.sqrt(max(float(weights @ deviation**2) - centre**2, 0.0)),
        acceleration_noise_limit=limit,
        acceleration_noise_quantiles=np.interp(_MIDDLES, np.cumsum(weights) - 0.5 * weights, deviation),
        acceleration_noise_seen=max(item.restricted for item in points) - without > _SEEN,
        log_evidence=float(logs.max()) + math.log(total * _STEP),
    )


def _density(item: Likelihood) -> float:
    """Log of the density of log ratio: its likelihood, and the prior flat in q^(1/4)."""
    return item.restricted + _PRIOR_POWER * math.log(item.noise.ratio)


def _grid(linearised: Linearisation, known: Rows | None, noise: Noise) -> list[Likelihood]:
    """Likelihoods at ratios a step apart, as far to both sides as they matter, in rising order."""
    low, high = math.log(LEAST_RATIO), math.log(MOST_RATIO)
    found: dict[int, Likelihood] = {}

    def at(place: int) -> float:
        if place not in found:
            found[place] = at_ratio(linearised, known, noise.variance, math.exp(low + _STEP * place))
        return _density(found[place])

    last = int((high - low) / _STEP)
    top = min(max(round((math.log(max(noise.ratio, LEAST_RATIO)) - low) / _STEP), 0), last)
    for way in (1, -1):  # uphill; the distribution has one top
        while 0 <= top + way <= last and at(top + way) > at(top):
            top += way
    first, end = top, top
    while first > 0 and at(first - 1) > at(top) - _DROP:
        first -= 1
    while end < last and at(end + 1) > at(top) - _DROP:
        end += 1
    return [found[place] for place in range(first, end + 1)]
