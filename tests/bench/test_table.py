"""The body of the bench moves as its equations of motion say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rw_ekf.attitude_bench.attitude import Axis, FlexibleMode


def test_the_body_follows_its_equation_of_motion_under_any_motion_of_the_wheel() -> None:
    """J dOmega/dt = T_d - J_w domega/dt, integrated by another method for a wheel that swings through zero."""
    inertia, wheel_inertia, disturbance, first = 0.5, 1.5e-3, -0.46e-3, 20.0

    def wheel(t: float) -> tuple[float, float, float]:
        """Angle, speed and acceleration."""
        return (
            first * t - 0.5 * t * t + 3.0 * (1.0 - math.cos(0.7 * t)) / 0.7,
            first - t + 3.0 * math.sin(0.7 * t),
            -1.0 + 2.1 * math.cos(0.7 * t),
        )

    def motion(t: float, y: np.ndarray) -> list[float]:
        return [y[1], (disturbance - wheel_inertia * wheel(t)[2]) / inertia]

    times = np.linspace(0.0, 60.0, 25)
    found = solve_ivp(motion, (0.0, 60.0), [0.0, 0.0], t_eval=times, rtol=1e-10, atol=1e-13)
    axis = Axis(inertia, wheel_inertia, disturbance, first)
    for i, t in enumerate(times):
        angle, speed, _ = wheel(float(t))
        state = axis.at(float(t), speed, angle)
        assert state.attitude_rad == pytest.approx(found.y[0, i], abs=1e-9)
        assert state.rate_rad_s == pytest.approx(found.y[1, i], abs=1e-10)


def test_momentum_is_conserved_where_nothing_acts_from_outside() -> None:
    """Body and wheel together keep J Omega + J_w omega without a disturbance."""
    axis = Axis(0.5, 1.5e-3, 0.0, 70.0)
    for speed in (70.0, 3.0, -40.0):
        rate = axis.at(12.0, speed, 5.0).rate_rad_s
        assert 0.5 * rate + 1.5e-3 * speed == pytest.approx(1.5e-3 * 70.0, rel=1e-12)


def test_a_flexible_appendage_rings_as_the_differential_equation_does() -> None:
    """An acceleration in steps, against an integration by another method."""
    frequency, damping, gain, step = 1.3, 0.02, 0.4, 0.01
    w = 2.0 * math.pi * frequency
    rates = np.cumsum(np.repeat([0.5, -0.2, 0.0, 0.3], 100)) * step
    mode = FlexibleMode(frequency, damping, gain)
    mode.step(0.0, 0.0)
    found = [0.0, 0.0]
    before = 0.0
    for rate in rates:
        acceleration = (rate - before) / step
        before = float(rate)
        solved = solve_ivp(
            lambda t, q, a=acceleration: [q[1], -2.0 * damping * w * q[1] - w * w * q[0] - gain * a],
            (0.0, step),
            found,
            rtol=1e-10,
            atol=1e-14,
        )
        found = [float(solved.y[0, -1]), float(solved.y[1, -1])]
        mode.step(float(rate), step)
        assert mode.deflection_rad == pytest.approx(found[0], abs=1e-10)
        assert mode.deflection_rad_s == pytest.approx(found[1], abs=1e-8)
