"""filterpy's extended Kalman filter with the wheel's transition in it: the one module that touches the library.

What filterpy 2.0 leaves open is settled here: `predict()` would be F @ x unless `predict_x` is overridden; x is kept
1-D with a 2-D innovation path of our own shapes; NaN and a broken covariance are stopped at the door; after a missing
sample y and S would be the previous one's, so that they are never read from the filter but returned by `compare`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

from rw_ekf.errors import FilterError
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.transition import transition
from rw_ekf.model.state import STATE_SIZE, StateIndex

Float64Array = NDArray[np.float64]

_H = np.zeros((1, STATE_SIZE))  # the speed is measured: (1, 0, 0, 0, 0); [F12] (9) prints omega in place of 1
_H[0, StateIndex.SPEED] = 1.0


class WheelEkf(ExtendedKalmanFilter):
    """Five states, one measured speed. x (5,), P (5, 5), R (1, 1) [rad^2/s^2]."""

    def __init__(self, constants: FilterConstants, mean: Float64Array, covariance: Float64Array) -> None:
        """Start from a belief; raises FilterError unless it is finite, symmetric and of the right shape."""
        super().__init__(dim_x=STATE_SIZE, dim_z=1)
        if np.shape(mean) != (STATE_SIZE,) or np.shape(covariance) != (STATE_SIZE, STATE_SIZE):
            raise FilterError(
                f"a belief has mean (5,) and covariance (5, 5); got {np.shape(mean)}, {np.shape(covariance)}"
            )
        self.constants = constants
        self.x = np.array(mean, dtype=np.float64)
        self.P = np.array(covariance, dtype=np.float64)
        self.R = np.array([[constants.speed_variance]])
        self.Q = np.zeros((STATE_SIZE, STATE_SIZE))
        self.F = np.eye(STATE_SIZE)
        self._factor = np.zeros((STATE_SIZE + 2, STATE_SIZE))
        self._curvature = 0.0
        self.check()

    def check(self) -> None:
        """Raise FilterError where the belief is not a Gaussian any more."""
        if not (np.isfinite(self.x).all() and np.isfinite(self.P).all()):
            raise FilterError(f"the filter's state is no longer finite: x = {self.x}, diag P = {np.diag(self.P)}")
        if (np.diag(self.P) < 0.0).any() or not np.allclose(self.P, self.P.T, rtol=1e-9, atol=1e-300):
            raise FilterError(f"the filter's covariance is no longer one: diag P = {np.diag(self.P)}")

    def predict_x(self, u: tuple[Sequence[float], Sequence[float]]) -> None:
        """Propagate x and set the first row of F (filterpy calls this from `predict`); u: (durations, currents)."""
        durations, currents = u
        c = self.constants
        row = np.zeros(STATE_SIZE)
        speed, self._curvature = transition(
            self.x,
            self.P,
            c.omega_s,
            c.law,
            c.near_zero_speed,
            durations,
            currents,
            0,
            len(durations),
            row,
            self._factor,
        )
        self.x[StateIndex.SPEED] = speed
        self.F[StateIndex.SPEED] = row

    def predict_over(self, dt: float, durations: Sequence[float], currents: Sequence[float]) -> None:
        """Predict over dt [s] under pieces of current (durations [s], currents [A]); process noise grows with dt."""
        c = self.constants
        # The speed's share depends on the predicted speed itself, so that it is added after filterpy's F P F' + Q.
        self.Q[range(1, 5), range(1, 5)] = (
            c.motor_gain_drift * dt,
            c.viscous_drift * dt,
            c.coulomb_drift * dt,
            c.static_drift * dt,
        )
        self.predict(u=(durations, currents))
        noise = c.acceleration_noise * dt + self._curvature
        if self.x[StateIndex.SPEED] == 0.0:
            noise += c.stuck_variance
        self.P[0, 0] += noise

    def grow_parameters(self, dt: float) -> None:
        """Let the parameters wander for dt [s] without touching the speed."""
        c = self.constants
        for i, rate in enumerate((c.motor_gain_drift, c.viscous_drift, c.coulomb_drift, c.static_drift), start=1):
            self.P[i, i] += rate * dt

    def seed_speed(self, speed_rad_s: float) -> None:
        """Start the speed afresh from a reading; the parameters and their covariance stay."""
        self.x[StateIndex.SPEED] = speed_rad_s
        self.P[StateIndex.SPEED, :] = 0.0
        self.P[:, StateIndex.SPEED] = 0.0
        self.P[StateIndex.SPEED, StateIndex.SPEED] = self.constants.speed_variance

    def compare(self, speed_rad_s: float) -> tuple[float, float]:
        """Innovation [rad/s] and its variance [rad^2/s^2] for a reading, before any update."""
        if not math.isfinite(speed_rad_s):
            raise FilterError(f"a speed of {speed_rad_s} rad/s reached the filter")
        return float(speed_rad_s - self.x[StateIndex.SPEED]), float(self.P[0, 0] + self.constants.speed_variance)

    def update_speed(self, speed_rad_s: float) -> None:
        """Update by a reading, in Joseph's form (filterpy's `update`)."""
        self.update(np.array([speed_rad_s]), HJacobian=lambda _: _H, Hx=lambda x: x[:1])
        # Joseph's form keeps P positive; symmetry to the last bit is ours to keep.
        self.P = 0.5 * (self.P + self.P.T)

    @property
    def std(self) -> Float64Array:
        """Standard deviations of the state, (5,)."""
        return np.sqrt(np.diag(self.P))
