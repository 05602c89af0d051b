"""What one log alone says of the parameters: the belief after it, less what was believed before it.

A filter that goes on from the day before gives estimates that share their data: days in a row are not independent, and
a trend through them would be told too surely. In information form a Gaussian belief is a sum: P1^-1 = P0^-1 + I and
P1^-1 m1 = P0^-1 m0 + i, of which I and i are the log's own (docs/fleet.md). They are told as the estimate that the log
would have given from the start of all, whose prior keeps apart what the log does not show.
"""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import Float64Array


def own_share(
    before: tuple[Float64Array, Float64Array],
    after: tuple[Float64Array, Float64Array],
    origin: tuple[Float64Array, Float64Array],
) -> tuple[Float64Array, Float64Array]:
    """Mean (n,) and covariance (n, n) of the log's own estimate; each argument such a pair.

    Directions in which the filter forgets faster than the log teaches have a negative difference: none of it is the
    log's. Raises LinAlgError where a covariance is none.
    """
    m0, P0 = before
    scale = np.sqrt(np.diag(P0))
    root = scale[:, None] * np.linalg.cholesky(P0 / np.outer(scale, scale))  # P0 = root root'
    whitened = np.linalg.solve(root, np.linalg.solve(root, after[1]).T)
    values, vectors = np.linalg.eigh(0.5 * (whitened + whitened.T))
    gained = np.maximum(1.0 / np.maximum(values, np.finfo(float).tiny) - 1.0, 0.0)
    turned = vectors.T @ np.linalg.solve(root, after[0] - m0)
    told = np.where(gained > 0.0, turned / values, 0.0)
    to_origin = np.linalg.solve(root, origin[0] - m0)
    prior = np.linalg.inv(np.linalg.solve(root, np.linalg.solve(root, origin[1]).T))
    information = vectors @ np.diag(gained) @ vectors.T + 0.5 * (prior + prior.T)
    covariance = np.linalg.inv(information)
    mean = covariance @ (vectors @ told + prior @ to_origin)
    return m0 + root @ mean, root @ covariance @ root.T
