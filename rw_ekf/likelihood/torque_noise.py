"""What is known of a wheel's torque noise before its record is looked at.

A torque that a model lacks looks like torque noise for as long as any amount of that may be supposed: at 5 rpm a
constant torque worth a chi-square of 50 beside the wheel's own noise is worth 8 to 18 beside noise that is free. Wheels
have little of it. With u the noise in units of what is usual, sqrt(q) = u scale, the density is Student's,

    log p(u) = -(nu + 1) / 2 log(1 + u^2 / nu),

flat where noise is usual or less, and with tails that a record can outvote: it is no limit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.filter.constants import DEFAULT_ACCELERATION_NOISE

_FREEDOM = 7.0  # nine in ten below 1.9 of the usual, one in a thousand above 5.4
_LEAST = DEFAULT_ACCELERATION_NOISE / 3.0  # one log that shows none does not prove that a wheel has none


@dataclass(frozen=True)
class TorqueNoisePrior:
    """A priori of the torque noise; scale: the usual standard deviation [rad/s per sqrt(s)], above 0."""

    scale: float = DEFAULT_ACCELERATION_NOISE

    @classmethod
    def of_healthy(cls, acceleration_noise: float) -> TorqueNoisePrior:
        """Of a wheel whose noise is known from other logs [rad/s per sqrt(s)]."""
        return cls(max(acceleration_noise, _LEAST))

    def log_density(self, density: float | Float64Array) -> Float64Array:
        """Log-density of sqrt(q), but for a constant; density: q [rad^2/s^2 per s], one or any array of them."""
        return np.asarray(-0.5 * (_FREEDOM + 1.0) * np.log1p(density / (_FREEDOM * self.scale**2)))
