"""Least squares by orthogonal transformation [CK13 (7)-(10)].

Each stretch is triangularised by Householder QR, which eliminates its initial speed; the rows left over are stacked
with the a priori and triangularised again, and the step is solved by back substitution, damped after Marquardt.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.identify.free_run_loss import FreeRunLoss, Point


def triangularised(matrix: Float64Array) -> Float64Array:
    """Upper triangle after Householder's transformation [CK13 (8)], (min(rows, columns), columns)."""
    return np.asarray(np.linalg.qr(matrix, mode="r"), dtype=np.float64)


@dataclass(eq=False, frozen=True)
class Eliminated:
    """A stretch after QR: its first row gives the first speed, head d_omega_0 + slopes dp = residual."""

    head: float
    slopes: Float64Array  # (p,)
    residual: float

    def first_speed_step(self, dp: Float64Array, least_head: float) -> float:
        """What the first speed moves by when the parameters move by dp; 0 where the stretch does not say."""
        return (self.residual - float(self.slopes @ dp)) / self.head if abs(self.head) > least_head else 0.0


@dataclass(eq=False, frozen=True)
class NormalTriangle:
    """The linearised loss with first speeds eliminated, root dp = residual, and what gives these back."""

    root: Float64Array  # (p, p) upper triangular; root' root is the information
    residual: Float64Array  # (p,)
    stretches: list[Eliminated]

    def damped_step(self, damping: float) -> Float64Array:
        """Solution (p,) of [CK13 (10)], each parameter held back in shares of its own information."""
        p = self.residual.size
        scale = np.sqrt(damping) * np.sqrt((self.root * self.root).sum(axis=0))
        stacked = np.vstack((self.root, np.diag(scale)))
        upper = triangularised(np.column_stack((stacked, np.concatenate((self.residual, np.zeros(p))))))
        return np.asarray(np.linalg.solve(upper[:p, :p], upper[:p, p]), dtype=np.float64)


def linearised(loss: FreeRunLoss, at: Point) -> NormalTriangle:
    """QR of every stretch, then of what they leave together with the a priori."""
    jacobian, residual = loss.sensitivity(at), loss.course.speed_rad_s - at.simulated
    parts, p = [], loss.size
    stack = [np.column_stack((loss.prior_root, loss.prior_root @ (loss.prior_mean - at.p)))]
    for run in loss.runs:
        use = loss.used[run.first : run.last]
        block = np.column_stack((jacobian[run.first : run.last][use], residual[run.first : run.last][use]))
        upper = triangularised(block * loss.weight)
        rows = np.zeros((p + 2, p + 2))
        rows[: upper.shape[0]] = upper
        head, *slopes = rows[0, :-1]
        parts.append(Eliminated(head, np.array(slopes), rows[0, -1]))
        stack.append(rows[1:-1, 1:])
    upper = triangularised(np.vstack(stack))
    return NormalTriangle(upper[:p, :p], upper[:p, p], parts)


def posterior_covariance(prior_root: Float64Array, root: Float64Array, variance_factor: float = 1.0) -> Float64Array:
    """(root' root)^-1 with the data's share scaled by the variance factor; the a priori's share is not data.

    Reckoned in units of the a priori, where its share is the identity: whatever the data lack, the result is a
    covariance, and none wider than the a priori.
    """
    to_natural = np.linalg.inv(prior_root)
    seen = root @ to_natural
    data = seen.T @ seen - np.eye(root.shape[0])
    values, vectors = np.linalg.eigh(0.5 * (data + data.T))
    spread = 1.0 / (1.0 + np.maximum(values, 0.0) / max(variance_factor, 1.0e-12))
    factor = to_natural @ vectors * np.sqrt(spread)
    return np.asarray(factor @ factor.T, dtype=np.float64)
