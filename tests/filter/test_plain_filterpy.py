"""A second opinion on the filter's step: filterpy's own filter, in which nothing is overridden but `predict_x`."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter

from rw_ekf.arrays import Float64Array
from rw_ekf.control.profiles import make_profile
from rw_ekf.control.profiles.make_profile import PROFILE_NAMES
from rw_ekf.filter.belief import DEFAULT_PRIOR, Belief
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.estimator import Estimator
from rw_ekf.filter.step import BAND
from rw_ekf.model.state import SPEED, STATE_SIZE
from rw_ekf.records import IssuedCommand, Outcome, WheelSample
from rw_ekf.wheel.interval import Pieces
from rw_ekf.wheel.transition import transition
from tests.truth import run_of
from tools.measure.runs import Run, constants_for


class PlainEkf(ExtendedKalmanFilter):  # type: ignore[misc]
    """The wheel's transition over a period of one current; covariance, gain and update are filterpy's."""

    def __init__(self, constants: FilterConstants, belief: Belief) -> None:
        super().__init__(dim_x=STATE_SIZE, dim_z=1)
        self.constants = constants
        self.x, self.P = belief.mean.copy(), belief.covariance.copy()
        self.R = np.array([[constants.speed_variance]])
        self.F = np.eye(STATE_SIZE)

    def predict_x(self, u: tuple[float, float]) -> None:
        """Over u: a period [s] and its current [A]."""
        period_s, current_A = u
        c = self.constants
        row = np.zeros(STATE_SIZE)
        pieces = Pieces([0.0], [period_s], [current_A])
        self.x[SPEED], curvature = transition(self.x, self.P, c.stribeck, pieces, 0, 1, row, np.zeros((7, STATE_SIZE)))
        self.F[SPEED] = row
        stuck = c.stuck_variance if self.x[SPEED] == 0.0 else 0.0
        drifts = (c.motor_gain_drift, c.viscous_drift, c.coulomb_drift, c.static_drift)
        speed = c.acceleration_density * period_s + curvature + stuck
        self.Q = np.diag([speed, *(drift * period_s for drift in drifts)])


def plain_run(run: Run, constants: FilterConstants, n: int) -> tuple[Float64Array, Float64Array]:
    """Means and sigmas (n, 5) of filterpy's filter over a run's first samples, the speed begun at its first reading."""
    time_s, reading, current = run.time_s, run.reading_rad_s, run.current_A
    ekf = PlainEkf(constants, DEFAULT_PRIOR)
    ekf.x[SPEED], ekf.P[SPEED, :], ekf.P[:, SPEED] = reading[0], 0.0, 0.0
    ekf.P[SPEED, SPEED] = constants.speed_variance
    means, stds = [ekf.x.copy()], [np.sqrt(np.diag(ekf.P))]
    H = np.eye(1, STATE_SIZE)
    for i in range(1, n):
        ekf.predict(u=(time_s[i] - time_s[i - 1], current[i - 1]))
        ekf.update(np.array([reading[i]]), HJacobian=lambda _: H, Hx=lambda x: x[:1])
        means.append(ekf.x.copy())
        stds.append(np.sqrt(np.diag(ekf.P)))
    return np.array(means), np.array(stds)


@pytest.mark.parametrize("profile", [name for name in PROFILE_NAMES if make_profile(name).duration_s is not None])
def test_the_step_is_filterpys_filter(profile: str) -> None:
    """Every mean and sigma of 200 s agrees to a billionth of a sigma, where nothing is gated, reset or held still."""
    run = run_of(profile, 3)
    n = min(2000, run.time_s.size)
    constants = constants_for()._replace(gate=1.0e9)
    means, stds = plain_run(run, constants, n)
    estimator = Estimator(constants, DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
    estimator.ekf.memory.now[BAND] = 0.0
    for i in range(n):
        found = estimator.step(WheelSample(float(run.time_s[i]), float(run.reading_rad_s[i])))
        estimator.command_issued(IssuedCommand(float(run.current_A[i]), 0.0))
        assert found.outcome is (Outcome.UPDATED if i else Outcome.FIRST)
        assert np.max(np.abs(np.array(found.values) - means[i]) / stds[i]) < 1e-9
        assert np.max(np.abs(np.array(found.stds) / stds[i] - 1.0)) < 1e-9
