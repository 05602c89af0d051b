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

from rw_ekf.arrays import Float64Array, by_identity
from rw_ekf.compiled import Kernel
from rw_ekf.likelihood import whitening as _whitening
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


@by_identity
class _Particles(NamedTuple):
    """Paths of the phase, each with an amplitude and a speed; arrays (m,)."""

    logs: Float64Array  # of amplitudes
    phase: Float64Array  # [rad], beyond that of the regressors
    cosine: Float64Array
    sine: Float64Array
    size: Float64Array  # the amplitude
    speed: Float64Array  # less the trajectory's
    weight: Float64Array  # log of it


def _begin(particles: _Particles) -> None:
    """Phases evenly over a turn."""
    for j in range(particles.phase.size):
        turns = j * 0.6180339887498949
        phase = 2.0 * math.pi * (turns - math.floor(turns))
        particles.phase[j] = phase
        particles.cosine[j], particles.sine[j] = math.cos(phase), math.sin(phase)
        particles.size[j] = math.exp(particles.logs[j])


def _move(particles: _Particles, keep: float, defect: float, u: float, v: float) -> None:
    """Carry speeds over an interval; u, v: what one unit of sine and cosine adds to it."""
    _, _, cosine, sine, size, x, _ = particles
    if u != 0.0 or v != 0.0:
        for j in range(x.size):
            x[j] = keep * x[j] + defect + size[j] * (u * cosine[j] + v * sine[j])
    else:
        for j in range(x.size):
            x[j] = keep * x[j] + defect


def _correct(particles: _Particles, reading: float, gain: float, half: float) -> None:
    """Weigh by a reading and move towards it; half: of one over its variance."""
    x, weight = particles.speed, particles.weight
    for j in range(x.size):
        e = reading - x[j]
        weight[j] -= half * e * e
        x[j] += gain * e


def _walk(particles: _Particles, spread: float, normals: Float64Array) -> None:
    """Advance phases as the angle is lost."""
    phase, cosine, sine = particles.phase, particles.cosine, particles.sine
    for j in range(phase.size):
        step = spread * normals[j]
        phase[j] += step
        c = cosine[j]
        cosine[j] = c - step * (sine[j] + 0.5 * step * c)
        sine[j] += step * (c - 0.5 * step * sine[j])


def _weigh(weight: Float64Array, mass: Float64Array) -> tuple[float, float, float]:
    """(largest log-weight, sum of the masses beside it, of their squares); mass (m,) becomes those."""
    top = weight[0]
    for j in range(1, weight.size):
        top = max(top, weight[j])
    mass_sum, squares = 0.0, 0.0
    for j in range(weight.size):
        mass[j] = math.exp(weight[j] - top)
        mass_sum += mass[j]
        squares += mass[j] * mass[j]
    return top, mass_sum, squares


def _draw_again(
    particles: _Particles,
    mass: Float64Array,
    mass_sum: float,
    normals: Float64Array,
    order_of: Any,
    fresh: Float64Array,
) -> None:
    """Resample by masses, amplitudes smoothed; order_of (m,): which each was. fresh (m,) is scratch."""
    logs, phase, cosine, sine, size, x, weight = particles
    m = logs.size
    mean, square, reached, j = 0.0, 0.0, 0.0, -1
    for slot in range(m):
        while reached <= (slot + 0.5) / m * mass_sum and j < m - 1:
            j += 1
            reached += mass[j]
        order_of[slot] = j
        mean += logs[j] / m
        square += logs[j] * logs[j] / m
    wide = math.sqrt(max(square - mean * mean, 0.0) * (1.0 - _SHRINK * _SHRINK))
    _reorder(logs, order_of, fresh)
    _reorder(x, order_of, fresh)
    _reorder(phase, order_of, fresh)
    for slot in range(m):
        logs[slot] = mean + _SHRINK * (logs[slot] - mean) + wide * normals[slot]
        cosine[slot], sine[slot] = math.cos(phase[slot]), math.sin(phase[slot])
        size[slot] = math.exp(logs[slot])
        weight[slot] = 0.0


def _reorder(values: Float64Array, order_of: Any, fresh: Float64Array) -> None:
    """Values (m,) of those that order_of (m,) names; fresh (m,) is scratch."""
    for slot in range(values.size):
        fresh[slot] = values[order_of[slot]]
    for slot in range(values.size):
        values[slot] = fresh[slot]


def _trace(turns: int, kept: Float64Array, parents: Any, knots: Float64Array, lines: Any, paths: Float64Array) -> None:
    """Phases (k, n) of those that are left after some turns: the mean, then single ones; kept, parents (turns, m).

    knots (turns,) and lines (m,) are scratch.
    """
    m = lines.size
    for number in range(paths.shape[0]):
        for j in range(m):
            lines[j] = j
        for back in range(turns - 1, -1, -1):
            for j in range(m):
                lines[j] = parents[back, lines[j]]
            if number == 0:
                knots[back] = 0.0
                for j in range(m):
                    knots[back] += kept[back, lines[j]] / m
            else:
                knots[back] = kept[back, lines[(2 * number - 1) * m // (2 * paths.shape[0])]]
        for i in range(paths.shape[1]):
            place = max((i + 1.0) / _EVERY - 1.0, 0.0)
            low = min(int(place), turns - 1)
            high = min(low + 1, turns - 1)
            paths[number, i] = knots[low] + (place - low) * (knots[high] - knots[low])


@by_identity
class _Scratch(NamedTuple):
    """What is remembered along a chain, and room to reckon in: (m,) but for the first three."""

    kept: Float64Array  # (rounds, m) phases where they may be drawn again; (0, m) where no paths are requested
    parents: Any  # (rounds, m) and whom each was drawn from
    knots: Float64Array  # (rounds,)
    order_of: Any
    fresh: Float64Array
    mass: Float64Array
    lines: Any

    @classmethod
    def of(cls, rounds: int, m: int) -> _Scratch:
        """For m particles."""
        kept, parents = np.zeros((rounds, m)), np.zeros((rounds, m), dtype=np.int64)
        whole = np.zeros(m, dtype=np.int64)
        return cls(kept, parents, np.zeros(rounds), whole, np.zeros(m), np.zeros(m), whole.copy())


def follow(
    chain: Chain,
    regressors: Float64Array,
    logs: Float64Array,
    normals: Float64Array,
    walk: float,
    q: float,
    R: float,
    paths: Float64Array,
) -> float:
    """Log-likelihood of a chain without a memory; `logs` (particles,) of amplitudes become those of the end.

    regressors (n, 2): what one unit of sine and cosine adds to each interval; walk: standard deviation of the phase in
    a second [rad]. `paths` (k, n), k may be 0, become phases beyond that of the regressors [rad]: the mean of those
    particles that are left at the end, then single ones.
    """
    m = logs.size
    particles = _Particles(logs, *(np.zeros(m) for _ in range(6)))
    scratch = _Scratch.of(chain.reading.size // _EVERY + 2 if paths.shape[0] > 0 else 0, m)
    return float(particle_pass(chain, regressors, particles, normals, walk, q, R, paths, scratch))


def _follow(
    chain: Chain, regressors: Float64Array, particles: _Particles, normals: Float64Array, walk: float, q: float,
    R: float, paths: Float64Array, scratch: _Scratch,
) -> float:  # fmt: skip
    """`follow`."""
    kept, parents, knots, order_of, fresh, mass, lines = scratch
    n, m = chain.reading.size, mass.size
    rounds = kept.shape[0]
    _begin(particles)
    total, p = 0.0, 0.0
    known = False
    drawn, turn = 0, 0
    for i in range(n):
        known = known and chain.follows[i]
        has = not math.isnan(chain.reading[i])
        if known:
            f = chain.slopes[i, 0]
            p = f * f * p + q * chain.noisy_s[i] + chain.extra[i]
            _move(particles, f, chain.defect[i], regressors[i, 0], regressors[i, 1])
            if has:
                S = p + R
                total -= 0.5 * math.log(S)
                _correct(particles, chain.reading[i], p / S, 0.5 / S)
                p *= 1.0 - p / S
        elif has:
            known = True
            p = R
            for j in range(m):
                particles.speed[j] = chain.reading[i]
        spread = walk * math.sqrt(chain.step_s[i])
        if spread > 0.0:
            drawn = drawn if drawn + m <= normals.size else drawn + m - normals.size
            _walk(particles, spread, normals[drawn : drawn + m])
            drawn += m
        if i % _EVERY != _EVERY - 1 and i != n - 1:
            continue
        top, mass_sum, squares = _weigh(particles.weight, mass)
        if rounds > 0:
            for j in range(m):
                kept[turn, j] = particles.phase[j]
                parents[turn, j] = j
        if mass_sum * mass_sum < _LEAST_EFFECTIVE * m * squares or i == n - 1:
            total += top + math.log(mass_sum / m)
            drawn = drawn if drawn + m <= normals.size else drawn + m - normals.size
            _draw_again(particles, mass, mass_sum, normals[drawn : drawn + m], order_of, fresh)
            drawn += m
            for j in range(m if rounds > 0 else 0):
                parents[turn, j] = order_of[j]
        turn += 1
    _trace(turn, kept, parents, knots, lines, paths)
    return total


def _example() -> tuple[Any, ...]:
    series, whole = np.zeros(2), np.zeros((2, 4))
    chain = Chain(np.zeros(2, np.bool_), series, series, whole, series, series, series, 0.0, series)
    particles = _Particles(*[series] * 7)
    return chain, np.zeros((2, 2)), particles, series, 1.0, 1.0, 1.0, np.zeros((0, 2)), _Scratch.of(0, 2)


particle_pass = Kernel(_follow, [_whitening, sys.modules[__name__]], _example, result=0.0)


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
    """What a model without a memory, and without any ripple, leaves, tested for ripples whose angle is lost slowly."""

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
        value = follow(self.linearised.chain, regressors, logs, _normals(), order * walk, q, R, paths)
        return float(value) + float(noise_term(self.linearised, R, ratio))


def _spread(sizes: tuple[float, float], count: int) -> Float64Array:
    """Logarithms of amplitudes, in no order: phases come in one."""
    low, high = sizes
    return np.random.default_rng(_SEED).permutation(np.linspace(math.log(low), math.log(high), count))
