"""Where the model is linear, the filter is the Kalman filter of the textbooks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from rw_ekf.arrays import Float64Array
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.constants import FilterConstants
from tests.filter.replay import Columns, compiled
from tools.measure.runs import constants_for

B = 0.02


def textbook(log: Columns, constants: FilterConstants, belief: Belief, direction: float) -> tuple[Float64Array, ...]:
    """Means (n, 5) and covariances (n, 5, 5) of a linear Kalman filter for d omega/dt = k I - B omega - direction c."""
    x, P = belief.mean.copy(), belief.covariance.copy()
    x[0], P[0, 0] = log.speed_rad_s[0], constants.speed_variance
    H = np.eye(5)[:1]
    means, covariances = [x.copy()], [P.copy()]
    for i in range(1, log.time_s.size):
        dt = log.time_s[i] - log.time_s[i - 1]
        A = np.zeros((5, 5))
        A[0] = (-B, log.current_A[i - 1], 0.0, -direction, 0.0)
        F = expm(A * dt)
        c = constants
        rates = (c.acceleration_density, c.motor_gain_drift, c.viscous_drift, c.coulomb_drift, c.static_drift)
        Q = np.diag(rates)
        Q[3:, 3:] += c.dry_walk
        x, P = F @ x, F @ P @ F.T + Q * dt
        if not np.isnan(log.speed_rad_s[i]):
            S = H @ P @ H.T + constants.speed_variance
            K = P @ H.T / S
            x = x + K[:, 0] * (log.speed_rad_s[i] - x[0])
            P = P - K @ S @ K.T
        means.append(x.copy())
        covariances.append(P.copy())
    return np.array(means), np.array(covariances)


def noisy_log(seed: int, k: float, c: float, start: float, bias_A: float, amplitude_A: float) -> Columns:
    """A wheel without Stribeck friction under a sine; uneven sample times, some readings missing."""
    rng = np.random.default_rng(seed)
    time_s = np.cumsum(rng.uniform(0.05, 0.15, 500))
    current = bias_A + amplitude_A * np.sin(time_s)
    speed = np.empty(500)
    omega = start
    for i in range(500):
        speed[i] = omega
        if i < 499:
            keep = np.exp(-B * (time_s[i + 1] - time_s[i]))
            omega = keep * omega + (1.0 - keep) / B * (k * current[i] - c)
    speed += 0.1 * rng.standard_normal(500)
    speed[rng.choice(np.arange(1, 500), 40, replace=False)] = np.nan
    return Columns(time_s, speed, current)


def frozen_viscous(constants: FilterConstants) -> FilterConstants:
    return constants._replace(viscous_drift=0.0, gate=1e9)


@pytest.mark.parametrize("walk", [0.0, 0.01])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_far_from_zero_speed_the_filter_is_the_linear_kalman_filter(direction: float, walk: float) -> None:
    """With b known and the speed far away, mean and covariance equal a textbook filter's for unknown k and c.

    Whether dry friction walks at random or not.
    """
    log = noisy_log(1, 15.0, 0.6 * direction, 200.0 * direction, 0.1 * direction, 0.2)
    belief = Belief(np.array([0.0, 12.0, B, 0.9, 0.9]), np.diag([1.0, 9.0, 0.0, 0.25, 0.25]))
    constants = frozen_viscous(constants_for())._replace(dry_walk=walk**2)
    run = compiled(log, constants, belief)
    means, covariances = textbook(log, constants, belief, direction)
    assert np.nanmin(np.abs(log.speed_rad_s)) > 100.0
    np.testing.assert_allclose(run.states, means, rtol=1e-9)
    np.testing.assert_allclose(run.covariance, covariances[-1], rtol=1e-7, atol=1e-14)
    np.testing.assert_allclose(run.stds**2, np.diagonal(covariances, axis1=1, axis2=2), rtol=1e-7, atol=1e-14)


def test_without_dry_friction_the_filter_is_linear_through_zero_speed_too() -> None:
    """With c = s = 0 known, the divided differences at zero speed are the derivatives, and no curvature is added."""
    log = noisy_log(2, 15.0, 0.0, 3.0, 0.0, 0.3)
    belief = Belief(np.array([0.0, 12.0, B, 0.0, 0.0]), np.diag([1.0, 9.0, 0.0, 0.0, 0.0]))
    constants = frozen_viscous(constants_for())._replace(coulomb_drift=0.0, static_drift=0.0)
    run = compiled(log, constants, belief)
    means, covariances = textbook(log, constants, belief, 0.0)
    assert np.count_nonzero(np.diff(np.sign(means[:, 0]))) > 5
    np.testing.assert_allclose(run.states, means, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(run.covariance, covariances[-1], rtol=1e-7, atol=1e-12)
