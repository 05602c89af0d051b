"""What noise alone makes of a group of regressors, drawn from the fit itself (docs/likelihood.md, "The map").

Hat functions over time can follow a torque noise as well as any structure. Where a record has a noise that is barely
seen beside that of its readings, a model with a dozen of them does without it, and gains more than chi-square of as
many degrees of freedom has: of 60 healthy wheels four were accused so, at 4e-7 for one. The ratio of noises belongs to
what is fitted, so the same regression is run on records that have the fit's own noises and nothing else.
"""

from __future__ import annotations

import math

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.hypotheses.joint_regressors import statistics_alone
from rw_ekf.diagnosis.hypotheses.noise_ratios import Profiled
from rw_ekf.filter.consistency import skewed_tail
from rw_ekf.likelihood.fitting import Fit

_SEED = 20262
_SAMPLES, _LEAST_DRAWS, _MOST_DRAWS = 2_000_000, 30, 300


def p_values_by_draws(fit: Fit, profiled: Profiled, groups: list[Float64Array], statistics: list[float]) -> list[float]:
    """P(a statistic as large) of groups of regressors (n, m), noise alone; the tail is that of Pearson's type III."""
    if not groups:
        return []
    n = fit.trajectory.speed.size
    count = int(np.clip(_SAMPLES // max(n, 1), _LEAST_DRAWS, _MOST_DRAWS))
    alone = statistics_alone(profiled, groups, *noise_draws(fit, count))
    return [float(skewed_tail(np.array(found), drawn)[0]) for found, drawn in zip(statistics, alone, strict=True)]


def noise_draws(fit: Fit, count: int) -> tuple[Float64Array, Float64Array]:
    """Increments of speed and of memory (n, count; (0, count) without one) that a fit's noises make in its readings.

    A reading's own noise is an increment there, and is taken back, carried along, in the next.
    """
    chain, noise = fit.linearised.chain, fit.noise
    n = chain.reading.size
    rng = np.random.default_rng(_SEED)
    density = noise.ratio * noise.variance / fit.linearised.record.period_s
    moved = np.sqrt(density * chain.noisy_s + chain.extra)[:, None] * rng.standard_normal((n, count))
    misread = math.sqrt(noise.variance) * rng.standard_normal((n, count))
    before = np.concatenate((np.zeros((1, count)), misread[:-1]))
    follows = chain.follows[:, None]
    speed = np.where(follows, moved + misread - chain.slopes[:, :1] * before, 0.0)
    if fit.linearised.memory_jacobian.shape[0] == 0:
        return speed, np.zeros((0, count))
    return speed, np.where(follows, -chain.slopes[:, 2:3] * before, 0.0)
