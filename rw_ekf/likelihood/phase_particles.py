"""A ripple whose angle was integrated from speeds, not logged: particles follow the phase that is lost slowly.

Integrated readings lose the angle as a random walk, by R dt per second (one reading's noise in each sample), a ripple
of order n n times as much. Every particle is a path of the phase with an amplitude that stays; the speed given both is
Gaussian, with one variance for all (Doucet, de Freitas, Murphy and Russell 2000; amplitudes: Liu and West 2001). What
comes of it is the likelihood with all paths and amplitudes integrated out, and paths for a fit to begin with, which
follows the angle from there (`linearisation.py`; docs/likelihood.md, "An angle that is not logged").
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.compiled import compile_cached
from rw_ekf.likelihood.profile import LEAST_RATIO, noise_term
from rw_ekf.likelihood.whitening import Chain

if TYPE_CHECKING:
    from rw_ekf.likelihood.linearisation import Linearisation, Noise

FEW, MANY = 100, 400  # particles: for a first look at many orders, and for those that count
_EVERY = 5  # samples from one resampling to the next
_LEAST_EFFECTIVE = 0.5  # of the particles
_SHRINK = 0.99  # of the spread of log-amplitudes in a resampling
_DRAWS, _SEED = 1_000_003, 20263
_LESS_NOISE = 0.1  # of a fit's ratio of noises: what a ripple explains is no process noise any more
_PATHS = 3  # that a fit is begun with: the particles' mean, and single ones
_UNITS = 2.0  # nanoseconds of a particle and a sample


def _follow(
    chain: Chain,
    regressors: Float64Array,
    order: float,
    logs: Float64Array,
    normals: Float64Array,
    walk: float,
    q: float,
    R: float,
    paths: Float64Array,
) -> float:
    """Log-likelihood of a chain without a memory; `logs` (particles,) of amplitudes become those of the end.

    regressors (n, 2): what one unit of sine and cosine adds to each interval; walk: standard deviation of the angle in
    a second [rad]. `paths` (k, n), k may be 0, become phases beyond that of the regressors [rad]: the mean of those
    particles that are left at the end, then single ones.
    """
    n, m = chain.reading.size, logs.size
    wanted = paths.shape[0] > 0
    rounds = n // _EVERY + 2
    kept = np.zeros((rounds if wanted else 0, m))
    parents = np.zeros((rounds if wanted else 0, m), dtype=np.int32)
    phase = np.empty(m)
    cosine, sine, size = np.empty(m), np.empty(m), np.empty(m)
    x, weight = np.zeros(m), np.zeros(m)
    order_of, fresh, mass = np.empty(m, dtype=np.int32), np.empty(m), np.empty(m)
    for j in range(m):
        phase[j] = 2.0 * math.pi * ((j * 0.6180339887498949) % 1.0)
        cosine[j], sine[j], size[j] = math.cos(phase[j]), math.sin(phase[j]), math.exp(logs[j])
    total, p = 0.0, 0.0
    known = False
    drawn, turn = 0, 0
    for i in range(n):
        if not chain.follows[i]:
            known = False
        has = not math.isnan(chain.reading[i])
        spread = order * walk * math.sqrt(chain.step_s[i])
        if known:
            f, u, v = chain.slopes[i, 0], regressors[i, 0], regressors[i, 1]
            p = f * f * p + q * chain.noisy_s[i] + chain.extra[i]
            S = p + R
            gain, half = p / S, 0.5 / S
            y, defect = chain.reading[i], chain.defect[i]
            if u != 0.0 or v != 0.0:
                for j in range(m):
                    x[j] = f * x[j] + defect + size[j] * (u * cosine[j] + v * sine[j])
            else:
                for j in range(m):
                    x[j] = f * x[j] + defect
            if has:
                total -= 0.5 * math.log(S)
                for j in range(m):
                    e = y - x[j]
                    weight[j] -= half * e * e
                    x[j] += gain * e
                p *= 1.0 - gain
        elif has:
            known = True
            p = R
            for j in range(m):
                x[j] = chain.reading[i]
        if spread > 0.0:
            if drawn + m > normals.size:
                drawn = drawn + m - normals.size
            drawn_now = normals[drawn : drawn + m]  # with an offset in its index the loop would go one by one
            for j in range(m):
                step = spread * drawn_now[j]
                phase[j] += step
                c = cosine[j]
                cosine[j] = c - step * (sine[j] + 0.5 * step * c)
                sine[j] += step * (c - 0.5 * step * sine[j])
            drawn += m
        if i % _EVERY == _EVERY - 1 or i == n - 1:
            top = weight[0]
            for j in range(1, m):
                top = max(top, weight[j])
            mass_sum, squares, mean, square = 0.0, 0.0, 0.0, 0.0
            for j in range(m):
                mass[j] = math.exp(weight[j] - top)
                mass_sum += mass[j]
                squares += mass[j] * mass[j]
            if wanted:
                for j in range(m):
                    kept[turn, j] = phase[j]
                    parents[turn, j] = j
            if mass_sum * mass_sum < _LEAST_EFFECTIVE * m * squares or i == n - 1:
                total += top + math.log(mass_sum / m)
                reached, j = 0.0, -1
                for slot in range(m):
                    while reached <= (slot + 0.5) / m * mass_sum and j < m - 1:
                        j += 1
                        reached += mass[j]
                    order_of[slot] = j
                    mean += logs[j] / m
                    square += logs[j] * logs[j] / m
                wide = math.sqrt(max(square - mean * mean, 0.0) * (1.0 - _SHRINK * _SHRINK))
                if drawn + m > normals.size:
                    drawn = drawn + m - normals.size
                for slot in range(m):
                    fresh[slot] = mean + _SHRINK * (logs[order_of[slot]] - mean) + wide * normals[drawn + slot]
                drawn += m
                logs[:] = fresh
                for slot in range(m):
                    fresh[slot] = x[order_of[slot]]
                x[:] = fresh
                for slot in range(m):
                    fresh[slot] = phase[order_of[slot]]
                phase[:] = fresh
                for slot in range(m):
                    cosine[slot], sine[slot] = math.cos(phase[slot]), math.sin(phase[slot])
                    size[slot] = math.exp(logs[slot])
                    if wanted:
                        parents[turn, slot] = order_of[slot]
                weight[:] = 0.0
            turn += 1
    for number in range(paths.shape[0]):
        knots, lines = np.zeros(turn), np.arange(m)
        for back in range(turn - 1, -1, -1):
            for j in range(m):
                lines[j] = parents[back, lines[j]]
            if number == 0:
                for j in range(m):
                    knots[back] += kept[back, lines[j]] / m
            else:
                knots[back] = kept[back, lines[(2 * number - 1) * m // (2 * paths.shape[0])]]
        for i in range(n):
            place = max((i + 1.0) / _EVERY - 1.0, 0.0)
            low = min(int(place), turn - 1)
            high = min(low + 1, turn - 1)
            paths[number, i] = knots[low] + (place - low) * (knots[high] - knots[low])
    return total


def _example() -> tuple[Any, ...]:
    series, whole = np.zeros(2), np.zeros((2, 4))
    chain = Chain(np.zeros(2, np.bool_), series, series, whole, series, series, series, 0.0, series)
    return chain, np.zeros((2, 2)), 1.0, series, series, 1.0, 1.0, 1.0, np.zeros((0, 2))


follow = compile_cached(_follow, [sys.modules[__name__]], _example)


@lru_cache(maxsize=1)
def _normals() -> Float64Array:
    """The same for every hypothesis, so that differences between them are the record's."""
    return np.random.default_rng(_SEED).standard_normal(_DRAWS)


class Followed(NamedTuple):
    """What particles found of one order."""

    gain: float  # of the log-likelihood, amplitudes and paths of the phase integrated out
    size: float  # the amplitude, in the regressors' unit
    size_std: float
    ratio: float  # of noises


@dataclass(frozen=True)
class LostAngle:
    """What a model without a memory, and without any ripple, leaves, asked for ripples whose angle is lost slowly."""

    linearised: Linearisation
    noise: Noise

    def followed(self, regressors: Float64Array, order: float, sizes: tuple[float, float], particles: int) -> Followed:
        """The better of two ratios of noises; sizes: amplitudes are spread evenly in their logarithm between them.

        What gains nothing with the fit's own process noise explains none of it: it has no use for less.
        """
        none = np.zeros((0, regressors.shape[0]))

        def at(ratio: float) -> Followed:
            logs = _spread(sizes, particles)
            value = self._run(regressors, order, logs, ratio, none)
            size = math.exp(float(logs.mean()))
            return Followed(value - self._nothing, size, size * float(logs.std()), ratio)

        own, less = (max(share * self.noise.ratio, LEAST_RATIO) for share in (1.0, _LESS_NOISE))
        found = at(own)
        return max(found, at(less)) if found.gain > 0.0 and less < own else found

    def paths(self, regressors: Float64Array, order: float, size: float) -> Float64Array:
        """Phases (k, n) [rad] of a ripple of about this amplitude, beyond that of the regressors."""
        sizes = 0.5 * size, 2.0 * size
        ratio = self.followed(regressors, order, sizes, MANY).ratio
        paths = np.zeros((_PATHS, regressors.shape[0]))
        self._run(regressors, order, _spread(sizes, MANY), ratio, paths)
        return paths

    @cached_property
    def _nothing(self) -> float:
        """Log-likelihood without a ripple."""
        n = self.linearised.chain.reading.size
        return self._run(np.zeros((n, 2)), 1.0, np.zeros(1), max(self.noise.ratio, LEAST_RATIO), np.zeros((0, n)))

    def _run(
        self, regressors: Float64Array, order: float, logs: Float64Array, ratio: float, paths: Float64Array
    ) -> float:
        record, R = self.linearised.record, self.noise.variance
        record.work.charge(_UNITS * regressors.shape[0] * logs.size)
        walk, q = math.sqrt(R * record.period_s), ratio * R / record.period_s
        value = follow(self.linearised.chain, regressors, order, logs, _normals(), walk, q, R, paths)
        return float(value) + float(noise_term(self.linearised, R, ratio))


def _spread(sizes: tuple[float, float], count: int) -> Float64Array:
    """Logarithms of amplitudes, in no order: phases come in one."""
    low, high = sizes
    return np.random.default_rng(_SEED).permutation(np.linspace(math.log(low), math.log(high), count))
