"""The filter with its parameters held: a prediction-error filter for the speed alone."""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.model.state import SPEED, STATE_SIZE, FrictionParameters


def frozen(parameters: FrictionParameters, whole: Float64Array | None = None) -> tuple[Float64Array, Float64Array]:
    """A belief that is certain of its parameters: mean (n,), covariance (n, n) of zeros but for the speed.

    whole (n,): a state whose coefficients of effects are kept; n is 5 without it.
    """
    mean = np.zeros(STATE_SIZE) if whole is None else np.array(whole, dtype=np.float64)
    mean[:STATE_SIZE] = (0.0, *parameters)
    covariance = np.zeros((mean.size, mean.size))
    covariance[SPEED, SPEED] = 1.0
    return mean, covariance


def without_drift(constants: FilterConstants) -> FilterConstants:
    """The same constants with parameters that do not wander."""
    return constants._replace(
        motor_gain_drift=0.0, viscous_drift=0.0, coulomb_drift=0.0, static_drift=0.0, dry_walk=0.0
    )
