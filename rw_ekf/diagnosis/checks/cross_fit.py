"""Whether two parts of a record agree on an effect: what each makes of its size, everything else fitted there too.

An effect of the wheel acts whenever its cause does; what one stretch of a record alone needs is no effect. Along the
whole record's trajectory everything is linear (docs/likelihood.md eq. 3-5), and its whitened rows are independent, the
speed being continuous from block to block. So the rows of each part give a score and an information, and what they
dispute is a chi-square (Cochran, 1954, "The combination of estimates from different experiments").
"""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, spanning
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model_vector import prior_rows


def disputed_share(fit: Fit, name: str, part: BoolArray) -> float:
    """What `part` (n,) and the rest dispute of an effect's coefficients, of what they call for together (eq. 10b).

    One that knows next to nothing of them disputes nothing.
    """
    linearised, model = fit.linearised, fit.model
    own = [place for _, at in model.placed_of(name) for place in range(at.start, at.stop)]
    numbers = model.numbers_of(name)
    shapes = [place for place, (i, _) in enumerate(model.refined, start=model.known) if i in numbers]
    others = [place for place in range(model.vector.size) if place not in {*own, *shapes}]
    r, A, _ = linearised.whitened(fit.noise.ratio, fit.noise.variance, linearised.jacobian, linearised.memory_jacobian)
    pull = np.zeros((0, len(others))) if fit.prior is None else prior_rows(fit.prior, model)[0][:, others]
    chosen = part[linearised.innovation_at]
    (u, J), (v, K) = (
        _score_and_information(r[rows], A[rows][:, own], A[rows][:, others], pull, model.vector[own])
        for rows in (chosen, ~chosen)
    )
    together = _chi_square(u + v, J + K)
    return max(_chi_square(u, J) + _chi_square(v, K) - together, 0.0) / max(together, 1.0e-300)


def expected_excess(fit: Fit, by_part: Fit, part: BoolArray) -> float:
    """What numbers that `part` (n,) alone gives add to squared errors in the rest, on average, in units of the noise.

    by_part: the same model fitted to that part, its speed free wherever a stretch of it begins. The trace of A C A^T
    over the rest's whitened rows A along the whole record, C the covariance of the model's vector by that fit
    (eq. 10e): next to nothing where torque noise hides most, a tenth where a model leaves none and the speed of half a
    record has to be inferred from the other half's friction, and more than the noise itself where the part does not
    show what the rest needs.
    """
    linearised, known = fit.linearised, fit.model.known
    _, A, _ = linearised.whitened(fit.noise.ratio, fit.noise.variance, linearised.jacobian, linearised.memory_jacobian)
    return _excess(A[~part[linearised.innovation_at], :known], by_part.likelihood.covariance[:known, :known])


def _excess(rest: Float64Array, covariance: Float64Array) -> float:
    """The mean of a C a^T over rows (n, m)."""
    return float(np.mean(np.einsum("ij,jk,ik->i", rest, covariance, rest))) if rest.size else 0.0


def _score_and_information(
    r: Float64Array, own: Float64Array, others: Float64Array, pull: Float64Array, found: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Score (m,) and information (m, m) of an effect's coefficients in some rows, all else fitted there too.

    The score is that at zero; r is what the model leaves with the coefficients `found`.
    """
    lengths = np.linalg.norm(others, axis=0)
    seen = lengths > 0.0
    rows = np.vstack((others, pull))[:, seen] / lengths[seen]
    basis = spanning(rows)[: r.size]
    beside = own - basis @ (basis.T @ own)
    information = beside.T @ own
    return information @ found + beside.T @ r, information


def _chi_square(score: Float64Array, information: Float64Array) -> float:
    """Chi-square of the coefficients that some rows call for, where they say anything of them."""
    scale = np.sqrt(np.maximum(np.diag(information), 1.0e-300))
    sizes, axes = np.linalg.eigh(information / np.outer(scale, scale))
    known = sizes > 1.0e-9
    along = (axes.T @ (score / scale))[known]
    return float(along**2 @ (1.0 / sizes[known]))
