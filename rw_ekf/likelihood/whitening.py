"""Innovations of a linear filter along the trajectory, and of every regressor at once: a likelihood by least squares.

With delta the true speed (and friction with a memory) less the trajectory, p the parameters' corrections,

    delta[i+1] = F delta[i] + (end - trajectory[i+1]) + C p + w,   w ~ N(0, q dt + extra),
    reading - trajectory = delta + v

(docs/likelihood.md eq. 3-5) a Kalman filter with known q and R turns readings and regressors C alike into independent
numbers of unit variance: r - A p is white where the model holds. Everything after that is linear regression.

The state is (speed, memory); for a model without a memory the slopes by it, and from it, are zero.
"""

from __future__ import annotations

import math
import sys
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rw_ekf.arrays import BoolArray, Float64Array, by_identity
from rw_ekf.compiled import Kernel

State = tuple[float, float, float, float, float]  # speed, memory, and their covariance xx, xz, zz
_LARGE = 1.0e30  # of a product: its logarithm is due
# What an event has left of itself long after: below 1e-308 a processor takes thirty times as long for each sum.
_FADED = 1.0e-150


@by_identity
class Chain(NamedTuple):
    """The linear model along the trajectory, but for its regressors and noises; arrays over samples."""

    follows: BoolArray  # (n,)
    step_s: Float64Array  # (n,)
    noisy_s: Float64Array  # (n,) of the step, in which process noise moves the speed: none at rest
    slopes: Float64Array  # (n, 4) of (speed, memory) by (speed, memory), row by row
    defect: Float64Array  # (n,) predicted less trajectory speed
    memory_defect: Float64Array  # (n,)
    extra: Float64Array  # (n,) variance of a transition beyond process noise
    memory_variance: float  # of the memory where a stretch begins, 0 without one
    reading: Float64Array  # (n,) measured less trajectory, NaN where missing


def _first(chain: Chain, i: int, R: float) -> State:
    """What is known at the first reading of a stretch."""
    return chain.reading[i], 0.0, R, 0.0, chain.memory_variance


def _predicted(chain: Chain, i: int, q: float, state: State) -> State:
    """The state over the interval that leads to sample i."""
    x, z, pxx, pxz, pzz = state
    a, b, c, d = chain.slopes[i, 0], chain.slopes[i, 1], chain.slopes[i, 2], chain.slopes[i, 3]
    return (
        a * x + b * z + chain.defect[i],
        c * x + d * z + chain.memory_defect[i],
        a * (a * pxx + b * pxz) + b * (a * pxz + b * pzz) + q * chain.noisy_s[i] + chain.extra[i],
        a * (c * pxx + d * pxz) + b * (c * pxz + d * pzz),
        c * (c * pxx + d * pxz) + d * (c * pxz + d * pzz),
    )


def _corrected(state: State, left: float, gain: float, side: float) -> State:
    """The state with a reading that missed it by `left`; gain, side: of speed and memory."""
    x, z, pxx, pxz, pzz = state
    keep = 1.0 - gain
    return x + gain * left, z + side * left, keep * pxx, keep * pxz, pzz - side * pxz


def _carry(
    chain: Chain, i: int, regressors: Any, memory_regressors: Any, carried: Float64Array, held: Float64Array
) -> None:
    """Take what regressors have made of speed, carried (m,), and memory, held (m,), to sample i."""
    a, b, c, d = chain.slopes[i, 0], chain.slopes[i, 1], chain.slopes[i, 2], chain.slopes[i, 3]
    m = carried.size
    if memory_regressors.shape[0] > 0:
        for j in range(m):
            first = carried[j]
            carried[j] = a * first + b * held[j] + regressors[i, j]
            held[j] = c * first + d * held[j] + memory_regressors[i, j]
    elif b == 0.0 and c == 0.0:
        for j in range(m):
            carried[j] = a * carried[j] + regressors[i, j]
    else:
        for j in range(m):
            first = carried[j]
            carried[j] = a * first + b * held[j] + regressors[i, j]
            held[j] = c * first + d * held[j]


def _add(sums: Float64Array, carried: Float64Array, left: float, weight: float) -> None:
    """Add the products of one innovation to the lower triangle of `sums`."""
    m = carried.size
    for j in range(m):
        weighted = carried[j] * weight
        for k in range(j + 1):
            sums[j, k] += weighted * carried[k]
        sums[m, j] += weighted * left
    sums[m, m] += left * left * weight


def innovations_of(chain: Chain) -> NDArray[np.intp]:
    """Samples that have an innovation: those read, but the first of each stretch, which starts it."""
    read = np.flatnonzero(~np.isnan(chain.reading))
    stretch = np.cumsum(~chain.follows)[read]
    return np.asarray(read[1:][stretch[1:] == stretch[:-1]])


def whiten(
    chain: Chain,
    regressors: Float64Array,
    memory_regressors: Float64Array,
    q: float,
    R: float,
    r: Float64Array,
    A: Float64Array,
    sums: Float64Array,
) -> tuple[float, int]:
    """Fill r (n,) and A (n, m), untouched where there is no innovation; or, where `sums` has any size, that alone.

    Returns the sum of log S over the innovations there are, and how many. regressors (n, m); memory_regressors (n, m),
    or (0, m) where they are zero; sums (m + 1, m + 1): the lower triangle of (A, r)'(A, r), added to what is there.
    A stretch starts from its first reading, as nothing is known before it.
    """
    m = regressors.shape[1]
    found: tuple[float, int] = whitening_pass(
        chain, regressors, memory_regressors, q, R, r, A, sums, np.zeros(m), np.zeros(m)
    )
    return found


def _whiten(
    chain: Chain,
    regressors: Float64Array,
    memory_regressors: Float64Array,
    q: float,
    R: float,
    r: Float64Array,
    A: Float64Array,
    sums: Float64Array,
    carried: Float64Array,
    held: Float64Array,
) -> tuple[float, int]:
    """`whiten`; what regressors have made of speed and memory, carried and held (m,), is scratch."""
    n, m = regressors.shape
    summed = sums.shape[0] > 0
    known = False
    state = (0.0, 0.0, 0.0, 0.0, 0.0)
    total, count = 0.0, 0
    per_R, product = 1.0 / R, 1.0  # the product of S over R, at least one each
    for i in range(n):
        known = known and chain.follows[i]
        has = not math.isnan(chain.reading[i])
        if not known:
            if has:
                known = True
                state = _first(chain, i, R)
                for j in range(m):
                    carried[j] = 0.0
                    held[j] = 0.0
            continue
        state = _predicted(chain, i, q, state)
        _carry(chain, i, regressors, memory_regressors, carried, held)
        if not has:
            continue
        x, _, pxx, pxz, _ = state
        S = pxx + R
        weight = 1.0 / S
        gain, side = pxx * weight, pxz * weight
        left = chain.reading[i] - x
        if summed:
            _add(sums, carried, left, weight)
        else:
            root = math.sqrt(weight)
            r[i] = left * root
            for j in range(m):
                A[i, j] = carried[j] * root
        keep = 1.0 - gain
        for j in range(m):
            held[j] -= side * carried[j]
            faded = carried[j] * keep
            carried[j] = 0.0 if abs(faded) < _FADED else faded
        state = _corrected(state, left, gain, side)
        product *= S * per_R
        count += 1
        if product > _LARGE:
            total += math.log(product)
            product = 1.0
    return total + math.log(product) + count * math.log(R), count


def adjoint(chain: Chain, q: float, R: float, white: Float64Array, found: Float64Array) -> None:
    """Transpose of `whiten` for regressors of the speed, in `found` (n,): regressor' found = A' white.

    white (n,) is zero where there is no innovation.
    The memory's part is left out: this only screens frequencies.
    """
    n = chain.reading.size
    adjoint_pass(chain, q, R, white, found, np.zeros(n), np.zeros(n))


def _adjoint(
    chain: Chain, q: float, R: float, white: Float64Array, found: Float64Array, root: Float64Array, keep: Float64Array
) -> None:
    """`adjoint`; root, keep (n,): scratch, zero where it begins."""
    n = chain.reading.size
    known = False
    P = 0.0
    for i in range(n):
        if not chain.follows[i]:
            known = False
        has = not math.isnan(chain.reading[i])
        keep[i] = 1.0
        if not known:
            if has:
                known = True
                P = R
                keep[i] = 0.0
            continue
        f = chain.slopes[i, 0]
        P = f * f * P + q * chain.noisy_s[i] + chain.extra[i]
        if has:
            gain = P / (P + R)
            root[i] = 1.0 / math.sqrt(P + R)
            keep[i] = 1.0 - gain
            P *= 1.0 - gain
    following = 0.0
    for i in range(n - 1, -1, -1):
        found[i] = white[i] * root[i] + keep[i] * following
        following = chain.slopes[i, 0] * found[i] if chain.follows[i] else 0.0


def smooth(chain: Chain, q: float, R: float, means: Float64Array, variances: Float64Array) -> None:
    """(speed, memory) less trajectory given all readings of the stretch: means (n, 2), variances (n, 2).

    Bryson and Frazier's form: nothing is inverted, and a memory that fades leaves nearly singular covariances. Before
    a stretch's first reading: zero, with variance R and memory_variance.
    """
    n = chain.reading.size
    smoothing_pass(chain, q, R, means, variances, np.zeros((n, 5)), np.zeros(n, dtype=np.int8))


def _smooth(
    chain: Chain, q: float, R: float, means: Float64Array, variances: Float64Array, ahead: Float64Array, kind: Any
) -> None:
    """`smooth`; ahead (n, 5): predicted speed, memory, and their covariance xx, xz, zz; kind (n,).

    kind, zero where it begins: 0 nothing known, 1 the first reading, 2 predicted.
    """
    n = chain.reading.size
    now = (0.0, 0.0, 0.0, 0.0, 0.0)
    known = False
    for i in range(n):
        has = not math.isnan(chain.reading[i])
        known = known and chain.follows[i]
        if not known and not has:
            continue
        now = _predicted(chain, i, q, now) if known else _first(chain, i, R)
        ahead[i, 0], ahead[i, 1], ahead[i, 2], ahead[i, 3], ahead[i, 4] = now
        kind[i] = 2 if known else 1
        if known and has:
            x, _, pxx, pxz, _ = now
            S = pxx + R
            now = _corrected(now, chain.reading[i] - x, pxx / S, pxz / S)
        known = True
    l1, l2 = 0.0, 0.0  # adjoint of what comes later, and its expected curvature
    h11, h12, h22 = 0.0, 0.0, 0.0
    for i in range(n - 1, -1, -1):
        if kind[i] == 0:
            variances[i, 0], variances[i, 1] = R, chain.memory_variance
            l1, l2, h11, h12, h22 = 0.0, 0.0, 0.0, 0.0, 0.0
            continue
        pxx, pxz, pzz = ahead[i, 2], ahead[i, 3], ahead[i, 4]
        if kind[i] == 2 and not math.isnan(chain.reading[i]):
            S = pxx + R
            gain, side = pxx / S, pxz / S
            u = 1.0 - gain  # (I - K H)' = [[u, -side], [0, 1]]
            l1 = u * l1 - side * l2 - (chain.reading[i] - ahead[i, 0]) / S
            g11 = u * (u * h11 - side * h12) - side * (u * h12 - side * h22)
            h11, h12 = g11 + 1.0 / S, u * h12 - side * h22
        means[i, 0] = ahead[i, 0] - pxx * l1 - pxz * l2
        means[i, 1] = ahead[i, 1] - pxz * l1 - pzz * l2
        variances[i, 0] = pxx - pxx * (h11 * pxx + h12 * pxz) - pxz * (h12 * pxx + h22 * pxz)
        variances[i, 1] = pzz - pxz * (h11 * pxz + h12 * pzz) - pzz * (h12 * pxz + h22 * pzz)
        if kind[i] == 1:
            l1, l2, h11, h12, h22 = 0.0, 0.0, 0.0, 0.0, 0.0
            continue
        a, b, c, d = chain.slopes[i, 0], chain.slopes[i, 1], chain.slopes[i, 2], chain.slopes[i, 3]
        l1, l2 = a * l1 + c * l2, b * l1 + d * l2
        k11, k12 = h11 * a + h12 * c, h11 * b + h12 * d
        k21, k22 = h12 * a + h22 * c, h12 * b + h22 * d
        h11, h12, h22 = a * k11 + c * k21, a * k12 + c * k22, b * k12 + d * k22


def _chain() -> Chain:
    """An empty one, for its types."""
    series = np.zeros(0)
    return Chain(
        follows=np.zeros(0, np.bool_),
        step_s=series,
        noisy_s=series,
        slopes=np.zeros((0, 4)),
        defect=series,
        memory_defect=series,
        extra=series,
        memory_variance=0.0,
        reading=series,
    )


_SERIES, _WHOLE = np.zeros(0), np.zeros((0, 1))
_MODULES = [sys.modules[__name__]]
adjoint_pass = Kernel(_adjoint, _MODULES, lambda: (_chain(), 1.0, 1.0, *[_SERIES] * 4))
whitening_pass = Kernel(
    _whiten,
    _MODULES,
    lambda: (_chain(), _WHOLE, _WHOLE, 1.0, 1.0, _SERIES, _WHOLE, _WHOLE, _SERIES, _SERIES),
    result=(0.0, 0),
)
smoothing_pass = Kernel(
    _smooth, _MODULES, lambda: (_chain(), 1.0, 1.0, _WHOLE, _WHOLE, _WHOLE, np.zeros(0, dtype=np.int8))
)
