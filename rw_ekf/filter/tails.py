"""Tails of the distributions that residuals are judged by (Abramowitz & Stegun 1964: 6.5, 26.4).

A table's worth of arithmetic: the library that has it takes longer to import than a filter over an hour of readings.
"""

from __future__ import annotations

import math

import numpy as np

from rw_ekf.arrays import Float64Array

_CLOSE = 1.0e-16  # relative: where a sum or a fraction has settled
_MOST_TURNS = 20_000
_ALL = 1.0e300  # of a sum relative to its last term: the tail is one
_LEAST = 1.0e-300


def chi_square_tail(value: float, freedom: int) -> float:
    """P(chi-square with `freedom` >= 1 degrees exceeds value), by its finite sum (A&S 26.4.4-5)."""
    h = 0.5 * value
    if h <= 0.0 or math.isinf(h):
        return 1.0 if h <= 0.0 else 0.0
    first = 1.0 if freedom % 2 == 0 else 0.5
    tail = math.exp(-h) if freedom % 2 == 0 else math.erfc(math.sqrt(h))
    terms = round(0.5 * freedom - first)
    if terms == 0:
        return tail
    total = last = 1.0  # in units of the last term, h^(a - 1) exp(-h) / Gamma(a)
    a = first + terms
    for k in range(1, terms):
        last *= (a - k) / h
        total += last
        if last < _CLOSE * total:
            break
        if total > _ALL:
            return 1.0
    return min(tail + math.exp((a - 1.0) * math.log(h) - h - math.lgamma(a) + math.log(total)), 1.0)


def poisson_tail(count: int, expected: float) -> float:
    """P(a Poisson number of this mean > 0 is at least count >= 0), by the gamma function's series, however small."""
    if count == 0:
        return 1.0
    weight = math.exp(count * math.log(expected) - expected - math.lgamma(count))
    return min(weight * float(_series(np.array([float(count)]), np.array([expected]))[0]), 1.0)


def binomial_tail(count: int, of: int, chance: float) -> float:
    """P(a binomial number of `of` draws, 0 < chance < 1 each, is at least count >= 0), summed from its first term on.

    The first term must not be below the smallest number there is, as it may be far below the mean.
    """
    logs = math.lgamma(of + 1) - math.lgamma(count + 1) - math.lgamma(of - count + 1)
    term, tail = math.exp(logs + count * math.log(chance) + (of - count) * math.log1p(-chance)), 0.0
    while term > _CLOSE * tail:
        tail += term
        term *= (of - count) / (count + 1) * chance / (1.0 - chance)
        count += 1
    return min(tail, 1.0)


def gamma_tail(a: Float64Array, x: Float64Array) -> Float64Array:
    """Q(a, x), the upper tail of a gamma distribution of shape a > 0 at x >= 0, of their common shape.

    By its series below the mean, by its continued fraction above (A&S 6.5.29, 6.5.31).
    """
    a, x = np.broadcast_arrays(a, x)
    logs = np.vectorize(math.lgamma, otypes=[np.float64])
    with np.errstate(divide="ignore"):
        weight = np.exp(a * np.log(x) - x - logs(a))
    below = x < a + 1.0
    series = weight * _series(a, np.where(below, x, 0.0))
    fraction = weight * _fraction(a, np.where(below, a + 1.0, x))
    return np.asarray(np.clip(np.where(below, 1.0 - series, fraction), 0.0, 1.0))


def _series(a: Float64Array, x: Float64Array) -> Float64Array:
    """Sum of x^n / (a (a + 1) ... (a + n))."""
    term = 1.0 / a
    total = term.copy()
    for n in range(1, _MOST_TURNS):
        term = term * x / (a + n)
        total += term
        if np.all(term < _CLOSE * total):
            break
    return total


def _fraction(a: Float64Array, x: Float64Array) -> Float64Array:
    """1/(x + 1 - a - 1 (1 - a)/(x + 3 - a - 2 (2 - a)/(x + 5 - a - ...))), by Lentz's method."""
    b = x + 1.0 - a
    c = np.full_like(b, 1.0 / _LEAST)
    d = 1.0 / b
    found = d.copy()
    for n in range(1, _MOST_TURNS):
        numerator = -n * (n - a)
        b = b + 2.0
        d = numerator * d + b
        d = 1.0 / np.where(np.abs(d) < _LEAST, _LEAST, d)
        c = b + numerator / c
        c = np.where(np.abs(c) < _LEAST, _LEAST, c)
        change = c * d
        found = found * change
        if np.all(np.abs(change - 1.0) < 4.0 * _CLOSE):
            break
    return found
