"""What a belief is worth beside another: whether a run has learned anything, and whether it may replace what stands."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rw_ekf.model.state import PARAMETER_COUNT

if TYPE_CHECKING:
    from rw_ekf.arrays import Float64Array

# One of the four parameters known twice as well, or several a little better. Two seconds of motion bring three times
# as much, a wheel at rest nothing: a third more or less changes no run.
_LEARNED = math.log(2.0)
# Every parameter known half as well: what a quarter of the data gives, because a sigma goes with their root. A run as
# long as those before replaces what they learned, a short test does not; a third more or less is a fifth or a third of
# the data.
_WORSE = PARAMETER_COUNT * math.log(2.0)


def has_learned(before: Float64Array, after: Float64Array) -> bool:
    """Whether the four parameters, covariances (4, 4), are known better after than before."""
    return _gained(before, after) >= _LEARNED


def may_replace(standing: Float64Array, new: Float64Array) -> bool:
    """Whether a new covariance (4, 4) of the parameters is of as much worth as the one that stands there."""
    return _gained(standing, new) >= -_WORSE


def _gained(before: Float64Array, after: Float64Array) -> float:
    """By how much the volume of one sigma has shrunk [nats]."""
    return 0.5 * float(np.linalg.slogdet(before)[1] - np.linalg.slogdet(after)[1])
