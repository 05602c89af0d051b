"""Which of the arrays that a file holds are columns of one table: numeric vectors of the most common length."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np


def vector_of(value: Any) -> Any:
    """Flatten a numeric vector (n,), (1, n) or (n, 1), in the byte order of this machine; None for anything else."""
    array = np.asarray(value)
    if array.dtype.kind not in "fiub" or array.ndim > 2 or (array.ndim == 2 and min(array.shape) > 1):
        return None
    kind = np.dtype(np.float64) if array.dtype.itemsize > 8 else array.dtype.newbyteorder("=")
    return array.reshape(-1).astype(kind, copy=False)


def vectors_of(content: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Columns (name, vector): those of the most common length, the longer in a tie; single values only if alone."""
    vectors = {key: vector_of(value) for key, value in content.items()}
    found = {key: value for key, value in vectors.items() if value is not None}
    lengths = Counter(len(value) for value in found.values() if len(value) > 1) or Counter(map(len, found.values()))
    if not lengths:
        return []
    rows = max(lengths, key=lambda length: (lengths[length], length))
    return [(key, value) for key, value in found.items() if len(value) == rows]
