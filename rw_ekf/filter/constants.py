"""The numbers that steer the filter, in SI, as one flat named tuple that Python and numba both read."""

from __future__ import annotations

from typing import NamedTuple

from rw_ekf.model.friction import Stribeck


class FilterConstants(NamedTuple):
    """Everything a step needs besides the state and the sample.

    Process noise: the speed takes white acceleration noise of density `acceleration_noise` (its variance grows by this
    much a second); each parameter is a random walk of variance rate `*_drift`. docs/filter.md eq. 4.
    """

    stribeck: Stribeck
    speed_variance: float  # R [rad^2/s^2]
    acceleration_noise: float  # [rad^2/s^2 per s]
    motor_gain_drift: float  # [(rad/s^2/A)^2 per s]
    viscous_drift: float  # [1/s^2 per s]
    coulomb_drift: float  # [(rad/s^2)^2 per s]
    static_drift: float  # [(rad/s^2)^2 per s]
    gate: float  # accepted while NIS <= gate [-]
    stuck_variance: float  # speed variance kept while the wheel is believed stuck [rad^2/s^2]
    max_gap_s: float  # a longer interval re-seeds the speed
    reseed_after: int  # this many gated samples in a row re-seed the speed

    def with_stribeck_speed(self, omega_s: float) -> FilterConstants:
        """The same beside another Stribeck speed [rad/s]."""
        return self._replace(stribeck=self.stribeck._replace(omega_s=omega_s))
