"""Which of two models a log speaks for, where one of them refuses what it cannot foretell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import rw_ekf
from rw_ekf.model_comparison import compared


def test_a_model_gains_nothing_by_the_readings_that_it_refuses() -> None:
    """Of 1.6 and 2.2 times the gain, each held for sure, the nearer is the likelier, though the other refuses more."""
    log = rw_ekf.simulate("identification", seed=4, duration_s=300.0, speed_noise_rpm=20.0)
    right = rw_ekf.fit(log).model
    sure = tuple(tuple(float(v) for v in row) for row in 1.0e-6 * np.array(right.covariance))
    near, far = (
        replace(
            right, parameters=right.parameters._replace(motor_gain=times * right.parameters.motor_gain), covariance=sure
        )
        for times in (1.6, 2.2)
    )
    first, second = compared(right, near, log).log_likelihoods or (0.0, 0.0)
    assert first > second + 1000.0
    nearer, farther = compared(near, far, log).log_likelihoods or (0.0, 0.0)
    assert nearer == second > farther + 1000.0
