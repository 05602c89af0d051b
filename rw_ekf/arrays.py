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
