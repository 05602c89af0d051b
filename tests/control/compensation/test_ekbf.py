"""The filter is the Kalman filter of its stochastic differential equation, unbiased where the wheel is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from rw_ekf.control.compensation.ekbf import FrictionKalman, GaussMarkov, KalmanBucyCompensation
from tests.control.compensation.bare_wheel import COULOMB, GAIN, BareWheel, coulomb

NOISE = 0.1


@pytest.mark.parametrize("time_constant_s", [0.3, 5.0, 500.0])
def test_it_is_the_kalman_filter_of_its_process_at_uneven_intervals(time_constant_s: float) -> None:
    """Against textbook matrices, the noise of an interval by Van Loan's exponential."""
    draw = np.random.default_rng(2)
    walk = 0.4
    found = FrictionKalman(GaussMarkov(walk, time_constant_s))
    found.seed(3.0, NOISE)
    x, P = np.array([3.0, 0.0]), np.diag([NOISE**2, 1.0])
    A, Q = np.array([[0.0, -1.0], [0.0, -1.0 / time_constant_s]]), np.diag([0.0, walk**2])
    for dt_s, drive, noise in np.column_stack([draw.uniform(0.01, 1.5, 60), *draw.normal(0.5, 1.0, (2, 60))]):
        block = expm(np.block([[-A, Q], [np.zeros((2, 2)), A.T]]) * dt_s)
        F = block[2:, 2:].T
        x, P = F @ x + np.array([drive * dt_s, 0.0]), F @ P @ F.T + F @ block[:2, 2:]
        read = x[0] + 0.3 * noise
        K = P[:, 0] / (P[0, 0] + NOISE**2)
        x, P = x + K * (read - x[0]), P - np.outer(K, P[0])
        found.predict(float(dt_s), float(drive))
        found.update(float(read), NOISE)
        assert found.friction_rad_s2 == pytest.approx(x[1], abs=1e-6)


def friction_found(believed_gain: float, time_constant_s: float = 1000.0) -> float:
    """Mean friction that is estimated of a wheel that is asked to accelerate at 1 rad/s^2."""
    scheme = KalmanBucyCompensation(believed_gain, GaussMarkov(time_constant_s=time_constant_s), NOISE)
    found = []

    class Watched:
        """The scheme, with its estimate noted."""

        def current_A(self, tick, request, known):  # type: ignore[no-untyped-def]
            found.append(scheme.filter.friction_rad_s2)
            return scheme.current_A(tick, request, known)

    draw = np.random.default_rng(1)
    BareWheel(coulomb(), speed=1.0, noise=lambda: draw.normal(0.0, NOISE)).run(Watched(), lambda t: 1.0, 100.0)
    return float(np.mean(found[200:]))


def test_a_constant_friction_is_estimated_without_bias_where_the_motor_gain_is_right() -> None:
    """To a hundredth, under noise; the forgetting of the Gauss-Markov state is what is left."""
    assert friction_found(GAIN) == pytest.approx(COULOMB, rel=0.01)


@pytest.mark.parametrize("share", [0.8, 1.25])
def test_a_wrong_inertia_or_motor_gain_is_read_as_friction(share: float) -> None:
    """The weakness that [L17] V.4 names: (k_believed - k) I of a motor is taken for friction."""
    k, c = GAIN, COULOMB
    current_A = (1.0 + c) / k  # that accelerates at 1 rad/s^2 against the friction
    assert friction_found(share * k) == pytest.approx(c + (share - 1.0) * k * current_A, rel=0.02)
    assert abs(friction_found(share * k) / c - 1.0) > 0.4
