"""filterpy's extended Kalman filter of a wheel: state, covariance and innovation under its names, the step of `step`.

The one module that touches the library. What filterpy 2.0 leaves open is settled here: `predict()` would be F @ x;
NaN and a broken covariance are stopped at the door; after a missing sample y and S are none, not the previous ones.
"""

from __future__ import annotations

import math

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.errors import FilterError
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.filterpy_alone import ExtendedKalmanFilter
from rw_ekf.filter.interval_inputs import Surroundings
from rw_ekf.filter.step import CONTINUOUS, Sample, advance, innovation_of, look_after, memory_of, weigh
from rw_ekf.model.state import SPEED, STATE_SIZE
from rw_ekf.wheel.effect_table import ABSENT, NO_EFFECTS, EffectSet
from rw_ekf.wheel.effect_transition import open_past


class WheelEkf(ExtendedKalmanFilter):
    """Five states, or more with effects; one measured speed. x (n,), P (n, n), R (1, 1) [rad^2/s^2], y and S (1, 1)."""

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
        self.check()
        self._known = self.table if n > STATE_SIZE else None
        memory = memory_of(self.x, self.P, constants, self._known, mends=True)
        short = {name: getattr(memory, name).tolist() for name in ("now", "gate", "stillness", "health")}
        self.memory = memory._replace(**short)  # lists: read and written in half the time
        self.F = memory.F

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

    def predict(self, sample: Sample, surroundings: Surroundings) -> int:
        """Bring x and P to a sample's time, or start the speed there; its outcome so far (`decisions`)."""
        self.y, self.S = np.full((1, 1), math.nan), np.full((1, 1), math.nan)
        interval, pieces = surroundings
        return advance(self.x, self.P, self.memory, self.constants, self._known, sample, pieces, interval)

    def update(self, sample: Sample) -> int:
        """Weigh a sample's reading: UPDATED, GATED or RESEEDED; y [rad/s] and S [rad^2/s^2] are its innovation's."""
        self.y[0, 0], self.S[0, 0] = innovation_of(self.x, self.P, self.constants, sample)
        return weigh(self.x, self.P, self.memory, self.constants, self._known, sample)

    def look_after(self, sample: Sample, what: int) -> int:
        """Reset what is broken after a sample of outcome `what`: WELL, or what was wrong (`health`)."""
        judged = (0.0, 1.0) if math.isnan(self.y[0, 0]) else (float(self.y[0, 0]), float(self.S[0, 0]))
        return look_after(self.x, self.P, self.memory, self.constants, self._known, sample, what, judged)

    def settle_current(self, current_A: float) -> None:
        """Let a lagging current begin at the first command that is known, and in doubt by as much."""
        if self.table.lag_state_at != ABSENT:
            self.x[self.table.lag_state_at] = current_A
        open_past(self.x, self.P, self.table, current_A)

    @property
    def is_continuous(self) -> bool:
        """Whether the last sample was predicted from the one before."""
        return bool(self.memory.now[CONTINUOUS])

    @property
    def speed_rad_s(self) -> float:
        """Believed speed."""
        return float(self.x[SPEED])

    @property
    def std(self) -> Float64Array:
        """Standard deviations of the state, (n,)."""
        return np.sqrt(np.diag(self.P))
