"""Names of the array types in signatures, and what a tuple that holds an array must not do."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
Int64Array = NDArray[np.int64]
Complex128Array = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]
_Kind = TypeVar("_Kind")


def by_identity(kind: type[_Kind]) -> type[_Kind]:
    """A named tuple that holds arrays equals itself alone, as a dataclass with eq=False does.

    To compare such tuples member by member would ask an array for its truth, which raises ValueError: with `==`, and
    with `in`, `index` and `count` of any list that holds two of them.
    """
    kind.__eq__ = object.__eq__  # type: ignore[method-assign]
    kind.__ne__ = object.__ne__  # type: ignore[method-assign]
    kind.__hash__ = object.__hash__  # type: ignore[method-assign]
    return kind


def spanning(rows: Float64Array, least: float = 1.0e-8) -> Float64Array:
    """Orthonormal basis (n, q) of what columns (n, p) span, directions shorter than a share of the longest left out.

    By the triangle of a QR factorisation and its singular values, which takes half as long as those of the rows: the
    basis is orthonormal to some 1e-16 over that share.
    """
    triangle = np.asarray(np.linalg.qr(rows, mode="r"))
    _, sizes, axes = np.linalg.svd(triangle)
    used = sizes > least * max(float(sizes.max(initial=0.0)), 1.0e-300)
    return np.asarray(rows @ (axes[: sizes.size][used].T / sizes[used]))


def scaled_root(covariance: Float64Array) -> Float64Array:
    """Lower triangular L with L L' the covariance (n, n), of numbers of any size. Raises LinAlgError for none."""
    size = np.sqrt(np.diag(covariance))
    return np.asarray(size[:, None] * np.linalg.cholesky(covariance / np.outer(size, size)))
