"""filterpy's extended Kalman filter with the wheel's transition in it: the one module that touches the library.

What filterpy 2.0 leaves open is settled here: `predict()` would be F @ x unless `predict_x` is overridden; x is kept
1-D with a 2-D innovation path of our own shapes; NaN and a broken covariance are stopped at the door; after a missing
sample y and S would be the previous one's, so that they are never read from the filter but returned by `compare`.
"""

from __future__ import annotations

import math

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from rw_ekf.arrays import Float64Array
from rw_ekf.errors import FilterError
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.covariance import (
    drop_settled,
    predict_covariance_full,
    seed_speed,
    set_ceiling,
    update_joseph,
)
from rw_ekf.filter.stillness import (
    STILLNESS_SIZE,
    away_from_reference,
    dead_band,
    follow,
    start_following,
    unlearn_shift,
)
from rw_ekf.filter.surroundings import Surroundings
from rw_ekf.model.state import SPEED, STATE_SIZE
from rw_ekf.wheel.effect_transition import effect_transition, open_past, seed_hidden
from rw_ekf.wheel.table import ABSENT, NO_EFFECTS, EffectSet
from rw_ekf.wheel.transition import transition


class WheelEkf(ExtendedKalmanFilter):
    """Five states, or more with effects; one measured speed. x (n,), P (n, n), R (1, 1) [rad^2/s^2]."""

    def __init__(
        self,
        constants: FilterConstants,
        mean: Float64Array,
        covariance: Float64Array,
        effects: EffectSet = NO_EFFECTS,
        drift: Float64Array | None = None,
    ) -> None:
        """Start from a belief; raises FilterError unless it is finite, symmetric and of the right shape."""
        self.table = effects.table(drift)
        n = self.table.size
        super().__init__(dim_x=n, dim_z=1)
        if np.shape(mean) != (n,) or np.shape(covariance) != (n, n):
            raise FilterError(
                f"a belief has mean ({n},) and covariance ({n}, {n}); got {np.shape(mean)}, {np.shape(covariance)}"
            )
        self.constants = constants
        self.x = np.array(mean, dtype=np.float64)
        self.P = np.array(covariance, dtype=np.float64)
        self.R = np.array([[constants.speed_variance]])
        self.Q = np.zeros((n, n))
        self.F = np.eye(n)
        # The speed is measured: (1, 0, 0, 0, 0); [F12] (9) prints omega in place of 1.
        self._H = np.zeros((1, n))
        self._H[0, SPEED] = 1.0
        self._factor = np.zeros((STATE_SIZE + 2 if n == STATE_SIZE else 3 * n + 6, n))
        self._work = np.zeros((n, n))
        self._curvature = 0.0
        self.check()
        self._band = float(dead_band(self.P, constants.speed_variance, constants.acceleration_density))
        self._stillness = [0.0] * STILLNESS_SIZE
        start_following(self._stillness, self._band)
        self.ceiling = np.zeros(n)
        set_ceiling(self.ceiling, self.P, constants, self.table.drift)

    def check(self) -> None:
        """Raise FilterError where the belief is not a Gaussian any more."""
        P = self.P
        if math.isfinite(self.x.sum() + P.sum()) and P.diagonal().min() >= 0.0 and (P == P.T).all():
            return  # as it nearly always is, found out in half the time
        if not (np.isfinite(self.x).all() and np.isfinite(self.P).all()):
            raise FilterError(f"the filter's state is no longer finite: x = {self.x}, diag P = {np.diag(self.P)}")
        scale = np.sqrt(np.maximum(np.diag(self.P), 0.0))
        skewed = np.abs(self.P - self.P.T) > 1.0e-9 * np.outer(scale, scale) + 1.0e-300
        if (np.diag(self.P) < 0.0).any() or skewed.any():
            raise FilterError(f"the filter's covariance is no longer one: diag P = {np.diag(self.P)}")

    def predict_x(self, u: Surroundings) -> None:
        """Propagate x and set the rows of F that are not identity (filterpy calls this from `predict`)."""
        (interval, pieces), stribeck = u, self.constants.stribeck
        away = away_from_reference(self._stillness, self.x[SPEED], self._band, stribeck.omega_s)
        self.x[SPEED] -= away
        if self.table.size > STATE_SIZE:
            self._curvature = effect_transition(
                self.x, self.P, self.table, stribeck, pieces, interval, self.F, self._factor
            )
            if away != 0.0:
                self.x += self.F[:, SPEED] * away
            return
        row = np.zeros(STATE_SIZE)
        speed, self._curvature = transition(
            self.x, self.P, stribeck, pieces, interval.start, interval.stop, row, self._factor
        )
        self.x[SPEED] = speed if away == 0.0 else speed + row[SPEED] * away
        self.F[SPEED] = row

    def predict_over(self, dt: float, surroundings: Surroundings) -> None:
        """Predict over dt [s] under pieces of current; process noise grows with dt."""
        if self.table.hidden:  # one that has settled stands at the last bits of P: they are the compiled pass's
            self.predict_x(surroundings)
            noise = np.array((self._speed_noise(dt), *self._parameter_noise(dt)))
            predict_covariance_full(self.P, self.F, noise, self._work)
            drop_settled(self.P, self.table.hidden)
            return
        # The speed's share depends on the predicted speed itself, so that it is added after filterpy's F P F' + Q.
        np.fill_diagonal(self.Q, (0.0, *self._parameter_noise(dt)))
        self.predict(u=surroundings)
        self.P[SPEED, SPEED] += self._speed_noise(dt)

    def _speed_noise(self, dt: float) -> float:
        """Variance that the predicted speed gains in dt [s], by noise and by neglected curvature."""
        c = self.constants
        noise = c.acceleration_density * dt + self._curvature
        return noise + c.stuck_variance if self.x[SPEED] == 0.0 else noise

    def _parameter_noise(self, dt: float) -> tuple[float, ...]:
        """Variance that each state but the speed gains in dt [s]."""
        c = self.constants
        rates = (c.motor_gain_drift, c.viscous_drift, c.coulomb_drift, c.static_drift, *self.table.drift)
        return (*(rate * dt for rate in rates), *(0.0,) * self.table.hidden)

    def grow_parameters(self, dt: float) -> None:
        """Let the parameters wander for dt [s] without touching the speed."""
        for i, variance in enumerate(self._parameter_noise(dt), start=1):
            self.P[i, i] += variance

    def follow(self, dt: float) -> None:
        """Note the speed that is believed dt [s] later, for where it stands still (stillness.py)."""
        shift = follow(self._stillness, float(self.x[SPEED]), self._band, dt)
        if shift != 0.0:
            unlearn_shift(self.P, shift)

    def seed_speed(self, speed_rad_s: float, current_A: float = 0.0) -> None:
        """Start the speed, and hidden states, afresh from a reading; the parameters and their covariance stay."""
        self._start_speed(speed_rad_s, current_A)
        follow(self._stillness, speed_rad_s, self._band, 0.0)

    def wait_for_speed(self, current_A: float = 0.0) -> None:
        """Forget the speed, until it is seeded."""
        self._start_speed(0.0, current_A)

    def _start_speed(self, speed_rad_s: float, current_A: float) -> None:
        seed_speed(self.x, self.P, speed_rad_s, self.constants.speed_variance)
        if self.table.hidden:
            seed_hidden(self.x, self.P, self.table, current_A, self.constants.stribeck.omega_s)

    def settle_current(self, current_A: float) -> None:
        """Let a lagging current begin at the first command that is known, and in doubt by as much."""
        if self.table.lag_state_at != ABSENT:
            self.x[self.table.lag_state_at] = current_A
        open_past(self.x, self.P, self.table, current_A)

    def compare(self, speed_rad_s: float) -> tuple[float, float]:
        """Innovation [rad/s] and its variance [rad^2/s^2] for a reading, before any update."""
        variance = float(self.P[SPEED, SPEED] + self.constants.speed_variance)
        return float(speed_rad_s - self.x[SPEED]), variance

    def update_speed(self, speed_rad_s: float) -> None:
        """Update by a reading, in Joseph's form (filterpy's `update`; with hidden states that of the compiled pass)."""
        if self.table.hidden:
            update_joseph(self.x, self.P, *self.compare(speed_rad_s), self.constants.speed_variance, self._work[0])
            return
        self.update(np.array([speed_rad_s]), HJacobian=lambda _: self._H, Hx=lambda x: x[:1])
        # Joseph's form keeps P positive; symmetry to the last bit is ours to keep.
        self.P = 0.5 * (self.P + self.P.T)

    @property
    def speed_rad_s(self) -> float:
        """Believed speed."""
        return float(self.x[SPEED])

    @property
    def std(self) -> Float64Array:
        """Standard deviations of the state, (n,)."""
        return np.sqrt(np.diag(self.P))
