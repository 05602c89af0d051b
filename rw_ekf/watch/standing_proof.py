"""What a reading that stands still would make of the wheel: a joint proof over all the currents since it began.

If the wheel turned at the speed v that is read again and again, its speed did not leave v by more than some M, whatever
current was driven through it. With a = phi' theta (eq. 1 of `stuck_watch`) and the four parameters theta, that is

    | Phi_j' theta | <= M,      Phi_j = integral of phi from the first repetition to reading j,                 (3)

which is read as measurements of theta: zero, with the standard deviation M, one a second. Given what was believed of
theta before, N(theta_0, P), the squared innovations over their variances add up to

    D^2 = min over theta of (theta - theta_0)' P^-1 (theta - theta_0) + sum of (Phi_j' theta / M)^2,            (4)

the distance to the nearest wheel that does not move ([BLK01 (5.4.4)]: the innovations are independent). One current
cannot say more than eq. 1 does. Two that differ leave only a wheel without a gain, which no single one rules out: so a
reading that freezes in a run's first second, when nothing but a wide prior is known, is found as well.

[BLK01]: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, Wiley 2001.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rw_ekf.arrays import Float64Array

_LOOKS_PER_S = 1.0


class StandingProof:
    """Distance of what is believed of a wheel from one that stands at its reading; one for each reading that repeats.

    parameters: believed before it began (motor gain, viscous, Coulomb, static); covariance: theirs, (4, 4), with what
    the model may lack; within_rad_s: M, how far apart two speeds may be that read the same.
    """

    def __init__(self, parameters: Sequence[float], covariance: Float64Array, within_rad_s: float) -> None:
        self._mean = np.array(parameters, dtype=np.float64)
        self._P = np.array(covariance, dtype=np.float64)
        self._within = within_rad_s
        self._path = np.zeros(4)  # Phi
        self._beyond = 0.0  # what a model's effects have added to the path [rad/s]
        self.squared_distance = 0.0

    def add(self, phi: Sequence[float], beyond_rad_s2: float, dt_s: float) -> float:
        """Take an interval: phi = da/d(parameters), and the acceleration beyond them; return D^2 of eq. 4."""
        if not dt_s > 0.0:
            return self.squared_distance
        self._path += dt_s * np.array(phi)
        self._beyond += dt_s * beyond_rad_s2
        gain = self._P @ self._path
        variance = float(self._path @ gain) + self._within**2 / min(dt_s * _LOOKS_PER_S, 1.0)
        innovation = -(float(self._path @ self._mean) + self._beyond)
        self.squared_distance += innovation**2 / variance
        self._mean += gain * (innovation / variance)
        self._P -= np.outer(gain, gain) / variance
        return self.squared_distance
