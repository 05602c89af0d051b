"""Names of the array types in signatures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
Int64Array = NDArray[np.int64]
Complex128Array = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]
