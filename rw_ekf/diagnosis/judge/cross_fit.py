"""Whether two halves of a record agree on an effect: each is predicted with the coefficient that the other gives.

An effect of the wheel acts whenever its cause does; what one stretch of a record alone asks for is no effect. Along the
whole record's trajectory everything is linear (docs/diagnosis.md eq. 3-5), and its whitened rows are independent. So
the rows of each half give a coefficient and the other half judges it, nothing being refitted and the speed being
continuous from block to block (Stone, 1974; Chernozhukov et al., 2018, for the name).
"""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model import prior_rows


def cross_fitted_gain(fit: Fit, name: str, part: BoolArray) -> float:
    """Twice the log-likelihood that an effect gains where it is predicted: on `part` (n,) and on the rest, summed.

    An effect that is known badly by one half is drawn towards zero there, by a prior as wide as the effect is large.
    """
    linearised, model = fit.linearised, fit.model
    own = [place for term, at in model.placed if term.id == name for place in range(at.start, at.stop)]
    shapes = [place for place, (i, _) in enumerate(model.refined, start=model.known) if model.terms[i].id == name]
    others = [place for place in range(model.vector.size) if place not in {*own, *shapes}]
    r, A, _ = linearised.whitened(fit.noise.ratio, fit.noise.variance, linearised.jacobian, linearised.memory_jacobian)
    pull = np.zeros((0, len(others))) if fit.prior is None else prior_rows(fit.prior, model)[0][:, others]
    found = model.vector[own]
    width = np.full(found.size, max(float(found @ found) / found.size, 1.0e-300))
    chosen = part[linearised.innovation_at]
    halves = [_half(r[rows], A[rows][:, own], A[rows][:, others], pull, found) for rows in (chosen, ~chosen)]
    gain = 0.0
    for (score, information), (other_score, other_information) in (halves, halves[::-1]):
        estimate = np.linalg.solve(information + np.diag(1.0 / width), score)
        gain += float(2.0 * estimate @ other_score - estimate @ other_information @ estimate)
    return gain


def _half(
    r: Float64Array, own: Float64Array, others: Float64Array, pull: Float64Array, found: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Score (m,) and information (m, m) of an effect's coefficients in some rows, all else fitted there too.

    The score is that at zero; r is what the model leaves with the coefficients `found`.
    """
    lengths = np.linalg.norm(others, axis=0)
    seen = lengths > 0.0
    rows = np.vstack((others, pull))[:, seen] / lengths[seen]
    U, sizes, _ = np.linalg.svd(rows, full_matrices=False)
    basis = U[: r.size, sizes > 1.0e-8 * max(float(sizes.max(initial=0.0)), 1.0e-300)]
    beside = own - basis @ (basis.T @ own)
    information = beside.T @ own
    return information @ found + beside.T @ r, information
