"""The whitening filter is dense generalised least squares: every number follows from one covariance, written out."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.likelihood.whitening import Chain, adjoint, innovations_of, smooth, whiten

R, Q = 0.8, 0.3
NONE = np.zeros((0, 0))
SEEDS = range(4)


def random_chain(seed: int, *, memory: bool, samples: int = 34) -> Chain:
    """Three stretches; readings missing at their start, alone and in a row; uneven steps and extra variances."""
    rng = np.random.default_rng([seed, 1 if memory else 0])
    follows = np.ones(samples, dtype=bool)
    follows[[0, 11, 20]] = False
    slopes = rng.uniform(-0.3, 1.1, (samples, 4))
    if not memory:
        slopes[:, 1:] = 0.0
    reading = rng.normal(0.0, 2.0, samples)
    reading[[0, 5, 6, 7, 11, 12, 17]] = np.nan
    step = rng.uniform(0.05, 0.2, samples)
    return Chain(
        follows=follows,
        step_s=step,
        noisy_s=np.where(rng.random(samples) < 0.2, 0.0, step),
        slopes=slopes,
        defect=rng.normal(0.0, 0.5, samples),
        memory_defect=rng.normal(0.0, 0.5, samples) if memory else np.zeros(samples),
        extra=np.where(rng.random(samples) < 0.3, rng.uniform(0.0, 0.4, samples), 0.0),
        memory_variance=1.7 if memory else 0.0,
        reading=reading,
    )


def stretches(chain: Chain) -> list[tuple[int, int]]:
    """(first sample read, one behind the last) of every stretch: nothing is known before its first reading."""
    edges = [*np.flatnonzero(~chain.follows), chain.reading.size]
    found = []
    for a, b in pairwise(edges):
        read = a + np.flatnonzero(np.isfinite(chain.reading[a:b]))
        if read.size:
            found.append((int(read[0]), int(b)))
    return found


class Dense:
    """One stretch written out: mean and covariance of (speed, memory) at all its samples, given its first reading.

    Column j of `regressors` is what parameter j adds to the mean, for p = 1.
    """

    def __init__(
        self, chain: Chain, first: int, end: int, regressors: Float64Array, memory_regressors: Float64Array
    ) -> None:
        m = regressors.shape[1]
        count = end - first
        self.mean = np.zeros((count, 2))
        self.moved = np.zeros((count, 2, m))
        # The state at sample i is a sum of independent sources: the start's two, then one kick per transition.
        sources = np.zeros((count, 2, 1 + 1 + count))
        variances = np.array([R, chain.memory_variance, *np.zeros(count)])
        self.mean[0] = chain.reading[first], 0.0
        sources[0, 0, 0] = sources[0, 1, 1] = 1.0
        for i in range(1, count):
            at = first + i
            F = chain.slopes[at].reshape(2, 2)
            self.mean[i] = F @ self.mean[i - 1] + (chain.defect[at], chain.memory_defect[at])
            self.moved[i] = F @ self.moved[i - 1] + np.stack((regressors[at], memory_regressors[at]))
            sources[i] = F @ sources[i - 1]
            sources[i, 0, 2 + i] = 1.0
            variances[2 + i] = Q * chain.noisy_s[at] + chain.extra[at]
        self.covariance = np.einsum("iak,k,jbk->iajb", sources, variances, sources)
        self.read = np.array([i for i in range(1, count) if np.isfinite(chain.reading[first + i])], dtype=int)
        self.of_readings = self.covariance[self.read, 0][:, self.read, 0] + R * np.eye(self.read.size)
        self.error = chain.reading[first + self.read] - self.mean[self.read, 0]

    def smoothed(self) -> tuple[Float64Array, Float64Array]:
        """Conditional mean (count, 2) and variance (count, 2) given all readings."""
        cross = self.covariance[:, :, self.read, 0]
        gain = np.linalg.solve(self.of_readings, cross.reshape(-1, self.read.size).T).T.reshape(cross.shape)
        mean = self.mean + gain @ self.error
        variance = np.einsum("iaia->ia", self.covariance) - np.einsum("iak,iak->ia", gain, cross)
        return mean, variance


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("memory", [False, True])
def test_whitening_is_generalised_least_squares(seed: int, memory: bool) -> None:
    """r'r, log-determinant, A'r and A'A are those of the readings' covariance matrix, stretch by stretch."""
    chain = random_chain(seed, memory=memory)
    n = chain.reading.size
    rng = np.random.default_rng([seed, 9])
    regressors, memory_regressors = rng.normal(size=(n, 3)), rng.normal(size=(n, 3))
    if not memory:
        memory_regressors[:] = 0.0
    r, A = np.full(n, np.nan), np.zeros((n, 3))
    logs, count = whiten(chain, regressors, memory_regressors if memory else memory_regressors[:0], Q, R, r, A, NONE)
    squares, determinant, normal, target = 0.0, 0.0, np.zeros((3, 3)), np.zeros(3)
    read = []
    for first, end in stretches(chain):
        dense = Dense(chain, first, end, regressors, memory_regressors)
        slopes = dense.moved[dense.read, 0]
        squares += dense.error @ np.linalg.solve(dense.of_readings, dense.error)
        determinant += np.linalg.slogdet(dense.of_readings)[1]
        normal += slopes.T @ np.linalg.solve(dense.of_readings, slopes)
        target += slopes.T @ np.linalg.solve(dense.of_readings, dense.error)
        read += list(first + dense.read)
    used = np.isfinite(r)
    assert list(np.flatnonzero(used)) == read == list(innovations_of(chain))
    assert count == len(read)
    sums = np.zeros((4, 4))
    again = whiten(chain, regressors, memory_regressors if memory else memory_regressors[:0], Q, R, r[:0], A[:0], sums)
    assert again == (logs, count)
    assert np.allclose(sums, np.tril([[*row, 0.0] for row in normal] + [[*target, squares]]), rtol=1e-10)
    assert r[used] @ r[used] == pytest.approx(squares, rel=1e-10)
    assert logs == pytest.approx(determinant, rel=1e-10)
    assert np.allclose(A[used].T @ A[used], normal, rtol=1e-10)
    assert np.allclose(A[used].T @ r[used], target, rtol=1e-10)


def test_where_innovations_are_does_not_hang_on_what_is_foretold() -> None:
    """A model whose speed grows beyond all numbers between two readings has as many innovations as any other."""
    chain = random_chain(5, memory=False)
    wild = chain._replace(slopes=np.full(chain.slopes.shape, 1.0e200))
    assert np.array_equal(innovations_of(wild), innovations_of(chain))


def test_columns_without_memory_regressors_still_pass_through_the_memory() -> None:
    """No memory regressors means zeros: a push on the speed reaches the memory and comes back."""
    chain = random_chain(7, memory=True)
    n = chain.reading.size
    regressors = np.random.default_rng(7).normal(size=(n, 2))
    results: list[Float64Array] = []
    for held in (np.zeros((0, 2)), np.zeros((n, 2))):
        r, A = np.full(n, np.nan), np.zeros((n, 2))
        whiten(chain, regressors, held, Q, R, r, A, NONE)
        results.append(A)
    assert np.array_equal(results[0], results[1])


@pytest.mark.parametrize("seed", SEEDS)
def test_adjoint_is_the_transpose(seed: int) -> None:
    """regressor' (A' white) = (A regressor)' white for any regressor and white: screening sums what scoring would."""
    chain = random_chain(seed, memory=False)
    n = chain.reading.size
    rng = np.random.default_rng([seed, 5])
    regressors = rng.normal(size=(n, 4))
    r, A = np.full(n, np.nan), np.zeros((n, 4))
    whiten(chain, regressors, regressors[:0], Q, R, r, A, NONE)
    white = np.where(np.isfinite(r), rng.normal(size=n), 0.0)
    back = np.full(n, np.nan)
    adjoint(chain, Q, R, white, back)
    # A regressor enters with an interval alone: what stands where none leads to is never read.
    moving = np.where(chain.follows[:, None], regressors, 0.0)
    assert np.allclose(moving.T @ back, A.T @ white, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("memory", [False, True])
def test_smoothing_is_the_dense_conditional_mean(seed: int, memory: bool) -> None:
    """Means and variances given all readings of the stretch; before its first reading nothing but the start's own."""
    chain = random_chain(seed, memory=memory)
    n = chain.reading.size
    means, variances = np.full((n, 2), np.nan), np.full((n, 2), np.nan)
    means[:] = 0.0
    smooth(chain, Q, R, means, variances)
    seen = np.zeros(n, dtype=bool)
    for first, end in stretches(chain):
        none = np.zeros((n, 0))
        mean, variance = Dense(chain, first, end, none, none).smoothed()
        assert np.allclose(means[first:end], mean, rtol=1e-9, atol=1e-10)
        assert np.allclose(variances[first:end], variance, rtol=1e-8, atol=1e-10)
        seen[first:end] = True
    assert not seen.all()
    assert np.all(means[~seen] == 0.0)
    assert np.all(variances[~seen] == (R, chain.memory_variance))


def test_a_stretch_with_one_reading_has_no_innovation() -> None:
    """A single reading settles where the stretch is and says nothing of the model; it must not raise either."""
    chain = random_chain(3, memory=True)
    reading = chain.reading.copy()
    reading[12:20] = np.nan
    reading[15] = 0.4
    chain = chain._replace(reading=reading)
    n = reading.size
    r, A = np.full(n, np.nan), np.zeros((n, 1))
    whiten(chain, np.ones((n, 1)), np.zeros((0, 1)), Q, R, r, A, NONE)
    assert not np.isfinite(r[11:20]).any()
    assert np.all(A[11:20] == 0.0)
    means, variances = np.zeros((n, 2)), np.zeros((n, 2))
    smooth(chain, Q, R, means, variances)
    assert means[15, 0] == pytest.approx(0.4)
    assert np.isfinite(variances).all()
