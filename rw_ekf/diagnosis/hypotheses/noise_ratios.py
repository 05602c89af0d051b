"""A fitted model at a few ratios of noises: what is left of its record there, and what any gain would be worth."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, by_identity, spanning
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model_vector import prior_rows
from rw_ekf.likelihood.profile import LEAST_RATIO, noise_term
from rw_ekf.likelihood.work_budget import basis_units

_RATIOS_BELOW = 6


@by_identity
class Sums(NamedTuple):
    """Of regressors, whitened, beside a model's own: the whole of a regression on them."""

    whole: Float64Array  # (m,) squares of their lengths, before the model's own are projected out
    gram: Float64Array  # (m, m)
    products: Float64Array  # (m,) with what the model leaves


class Profiled:
    """A fit at ratios of noises from its own downwards, its record whitened and its own regressors projected out.

    Which ratio goes with which further regressors is decided by the restricted likelihood (Patterson & Thompson 1971;
    eq. 6a): regressors that follow a wandering speed would otherwise make it look as if it wandered less, and gain by
    that.
    """

    def __init__(self, fit: Fit, beside: Float64Array | None = None) -> None:
        """beside: more regressors (n, m) that are free, as the model's own are."""
        self.fit = fit
        linearised = self.linearised = fit.linearised
        variance = self.variance = fit.noise.variance
        self.ratios = _ratios(fit.noise.ratio)
        self.bases: list[Float64Array] = []
        self.residuals: list[Float64Array] = []
        self._together: list[Float64Array] = []  # (n, p + 1): a basis and the residual, which the two above show
        self._overlaps: list[Float64Array] = []  # (p, p + 1) of a basis with them
        self.rss: list[float] = []
        self.logs: list[float] = []
        self.restrictions: list[float] = []  # half the log-determinant of the model's own regressors
        for value in self.ratios:
            r, A, logs = linearised.whitened(value, variance, linearised.jacobian, linearised.memory_jacobian)
            self.places = linearised.innovation_at
            if beside is not None:
                A = np.concatenate((A, linearised.whitened(value, variance, beside)[1]), axis=1)
            Q = basis(A, fit)
            self.restrictions.append(_restriction(A, fit))
            del A  # of a long record each of these is a twentieth of all that a diagnosis needs
            together = np.empty((Q.shape[0], Q.shape[1] + 1), order="F")
            together[:, :-1], together[:, -1] = Q, r - Q @ (Q.T @ r)
            Q, left = together[:, :-1], together[:, -1]
            self.bases.append(Q)
            self.residuals.append(left)
            self._together.append(together)
            self._overlaps.append(Q.T @ together)
            self.rss.append(float(left @ left))
            self.logs.append(logs)
        self.count = self.residuals[0].size
        self.own = max(range(len(self.ratios)), key=lambda i: float(self.restricted(i, 0.0, 0, 0.0)))
        self.without = float(self.value(self.own, 0.0))

    def left(self, i: int, gain: float | Float64Array) -> Float64Array:
        """Variance left at the i-th ratio after gains (any shape) in the sum of squares."""
        return np.asarray(np.maximum(self.rss[i] - gain, 1.0e-9) / self.count)

    def value(self, i: int, gain: float | Float64Array) -> Float64Array:
        """Log-likelihoods at the i-th ratio after gains in the sum of squares, of their shape."""
        left = self.left(i, gain)
        known = noise_term(self.linearised, left * self.variance, self.ratios[i])
        return np.asarray(known - 0.5 * (self.count * np.log(left) + self.logs[i]))

    def restricted(
        self, i: int, gain: float | Float64Array, added: int, information: float | Float64Array
    ) -> Float64Array:
        """Restricted log-likelihoods (eq. 6a) of the model and `added` regressors, of the shape of `gain`.

        information: half the log-determinants of theirs, beside the model's own.
        """
        free = int(self.bases[i].shape[1]) + added
        known = 0.5 * free * np.log(self.left(i, gain)) - self.restrictions[i]
        return np.asarray(self.value(i, gain) + known - information)

    def sums(self, i: int, regressors: Float64Array) -> Sums:
        """Sums of squares and products of regressors (n, m) at the i-th ratio.

        With G = A - Q Q'A, G'G = A'A - S'(2 - Q'Q)S where S = Q'A: G need not be made. Q is not quite orthonormal, as
        the rows of the a priori are cut off.
        """
        _, A, _ = self.linearised.whitened(self.ratios[i], self.variance, regressors)
        shadow, taken, products = self.seen_by_own(i, A)
        squares = A.T @ A
        return Sums(np.diagonal(squares), squares - shadow.T @ taken, products)

    def sums_of_each(self, i: int, regressors: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
        """Of regressors (n, m), each by itself: its square whole, beside the model's own, and its product, (m,)."""
        _, A, _ = self.linearised.whitened(self.ratios[i], self.variance, regressors)
        shadow, taken, products = self.seen_by_own(i, A)
        whole = np.einsum("nm,nm->m", A, A)
        return whole, whole - np.einsum("pm,pm->m", shadow, taken), products

    def own_gains(self, squares: Float64Array, products: Float64Array) -> Float64Array:
        """Log-likelihoods that regressors gain, each by itself, at the model's own noises, by their sums there."""
        scale = 0.5 * self.count / max(self.rss[self.own], 1.0e-300)
        return np.asarray(scale * products**2 / np.maximum(squares, 1.0e-300))

    def seen_by_own(self, i: int, A: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
        """Of whitened columns A (n, m): S = Q'A (p, m), (2 - Q'Q)S, and what they have with the residual (m,)."""
        both, overlap = self._together[i].T @ A, self._overlaps[i]
        shadow = both[:-1]
        return shadow, 2.0 * shadow - overlap[:, :-1] @ shadow, both[-1] - shadow.T @ overlap[:, -1]

    def beside_own(self, i: int, regressors: Float64Array) -> Float64Array:
        """Columns whitened at the i-th ratio, the model's own projected out."""
        _, A, _ = self.linearised.whitened(self.ratios[i], self.variance, regressors)
        Q = self.bases[i]
        return A - Q @ (Q.T @ A)


def _restriction(A: Float64Array, fit: Fit) -> float:
    """Half the log-determinant of the information on the model's own vector."""
    normal = A.T @ A
    pull = _parameter_rows(fit, A.shape[1])
    normal += pull.T @ pull
    scale = np.sqrt(np.maximum(np.diag(normal), 1.0e-300))
    return float(0.5 * np.linalg.slogdet(normal / np.outer(scale, scale) + 1.0e-12 * np.eye(scale.size))[1]
                 + np.sum(np.log(scale)))  # fmt: skip


def _ratios(ratio: float) -> list[float]:
    """The model's own ratio, one above, and several below down to hardly any process noise."""
    low = math.log(LEAST_RATIO)
    top = max(math.log(ratio), low)
    steps = np.linspace(low, top, _RATIOS_BELOW + 1) if top > low + 1.0 else np.array([low, top])
    return [math.exp(v) for v in sorted({*steps.tolist(), top + 1.0})]


def basis(A: Float64Array, fit: Fit) -> Float64Array:
    """Orthonormal basis (n, p) of the span of A, the a priori of the parameters counted as rows, then cut off."""
    weights = np.linalg.norm(A, axis=0)
    weights[weights == 0.0] = 1.0
    pull = _parameter_rows(fit, A.shape[1])
    fit.linearised.record.work.charge(basis_units(*A.shape))
    return spanning(np.vstack((A, pull)) / weights)[: A.shape[0]]


def _parameter_rows(fit: Fit, count: int) -> Float64Array:
    """What is known of the four parameters beforehand, as rows of unit variance over all that is free, (4, count)."""
    known = np.zeros((0, 0)) if fit.prior is None else prior_rows(fit.prior.core, fit.model)[0]
    rows = np.zeros((known.shape[0], count))
    rows[:, : known.shape[1]] = known
    return rows
