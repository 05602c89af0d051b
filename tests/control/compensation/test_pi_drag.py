"""Cassini's drag estimator is its transfer function at any rate, its limiter limits, and (6) bounds what it misses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rw_ekf.control.compensation.pi_drag import (
    CASSINI_DAMPING,
    CASSINI_RAD_S,
    PiDrag,
    PiDragEstimator,
    PiDragParameters,
)
from tests.control.compensation.bare_wheel import BELIEVED, COULOMB, GAIN, BareWheel, coulomb

RISE_mNm, RISE_S = 2.5, 10.0


def triangle(t: float, fall_s: float) -> float:
    """The triangular impulses of [L17] Fig. 3 [mNm]."""
    return RISE_mNm * t / RISE_S if t < RISE_S else max(0.0, RISE_mNm * (1.0 - (t - RISE_S) / fall_s))


@pytest.mark.parametrize("period_s", [0.02, 0.1, 0.5])
@pytest.mark.parametrize(
    ("fall_s", "peak_mNm", "at_s", "integrator_mNm"), [(10.0, 1.468, 16.2, 0.69), (30.0, 1.988, 23.1, 1.23)]
)
def test_triangular_drag_gives_the_peaks_of_equation_1_at_any_rate(
    fall_s: float, peak_mNm: float, at_s: float, integrator_mNm: float, period_s: float
) -> None:
    """1.468 mNm at 16.2 s, 1.988 at 23.1 s; the integrator alone gives 0.69 and 1.23, nearer to what is printed."""
    estimator = PiDragEstimator()
    course = [
        (
            estimator.step(period_s, triangle((i + 0.5) * period_s, fall_s)),
            (i + 1) * period_s,
            estimator.integrator_path,
        )
        for i in range(round(100.0 / period_s))
    ]
    peak, time_s, _ = max(course)
    assert peak == pytest.approx(peak_mNm, abs=1e-3)
    assert time_s == pytest.approx(at_s, abs=0.5 * period_s + 0.06)
    assert max(held for _, _, held in course) == pytest.approx(integrator_mNm, abs=0.005)


def test_the_estimator_is_its_differential_equation_at_uneven_intervals() -> None:
    """de/dt = T_phy - T_est integrated by another method, drag constant between readings at random times."""
    draw = np.random.default_rng(3)
    w, damping = 0.9, 0.4
    estimator, state = PiDragEstimator(w, damping), np.zeros(2)
    for dt_s, drag in zip(draw.uniform(0.01, 3.0, 40), draw.normal(0.0, 1.0, 40), strict=True):

        def motion(t: float, x: np.ndarray, drag: float = drag) -> list[float]:
            error, integral = x
            return [drag - 2.0 * damping * w * error - w * w * integral, error]

        state = solve_ivp(motion, (0.0, dt_s), state, rtol=1e-10, atol=1e-12).y[:, -1]
        found = estimator.step(float(dt_s), float(drag))
        assert found == pytest.approx(2.0 * damping * w * state[0] + w * w * state[1], abs=1e-8)


def error_bound(rise_per_s: float, after_s: float, bandwidth_rad_s: float = CASSINI_RAD_S) -> float:
    """A exp(-xi w T) / (w sqrt(1 - xi^2)) [L17 (6)]: bounds T_phy - T_est, T after drag began to rise by A a second."""
    damped = math.sqrt(1.0 - CASSINI_DAMPING**2)
    return rise_per_s * math.exp(-CASSINI_DAMPING * bandwidth_rad_s * after_s) / (bandwidth_rad_s * damped)


def test_the_bounds_of_equation_6_are_the_printed_ones_and_hold() -> None:
    """3.608 and 1.157 mNm for a rise of 0.25 mNm/s in 10 s; at every time of the rise the estimator misses less."""
    rise = RISE_mNm / RISE_S
    assert error_bound(rise, RISE_S) == pytest.approx(3.608, abs=1e-3)
    assert error_bound(rise, RISE_S, 2.0 * CASSINI_RAD_S) == pytest.approx(1.157, abs=1e-3)
    for bandwidth in (CASSINI_RAD_S, 2.0 * CASSINI_RAD_S):
        estimator = PiDragEstimator(bandwidth)
        for i in range(300):
            missed = rise * (i + 1) * 0.1 - estimator.step(0.1, rise * (i + 0.5) * 0.1)
            assert abs(missed) <= error_bound(rise, (i + 1) * 0.1, bandwidth) + 1e-3


def test_a_constant_friction_is_compensated_without_bias_and_a_wrong_motor_gain_with_it() -> None:
    """After the transient the wheel accelerates as it is asked to, its motor a fifth weaker than its data sheet's."""
    wheel = BareWheel(coulomb(), speed=1.0)
    wheel.run(PiDrag(BELIEVED._replace(motor_gain=1.25 * GAIN), PiDragParameters()), lambda t: 0.3, 60.0)
    assert (wheel.speeds[-1] - wheel.speeds[-101]) / 10.0 == pytest.approx(0.3, rel=1e-4)


def test_the_limiter_limits_and_does_not_wind_the_estimator_up() -> None:
    """Under ten times its limit for a minute it adds that and no more, and after it what it added before."""

    def friction(time_s: float, speed: float) -> float:
        return 20.0 * COULOMB if 30.0 < time_s < 90.0 else COULOMB

    wheel = BareWheel(friction, speed=1000.0)
    wheel.run(PiDrag(BELIEVED, PiDragParameters(bandwidth_rad_s=0.6, limit_of_static=2.0)), lambda t: 0.0, 130.0)
    current_A = np.array(wheel.currents)
    assert np.abs(current_A).max() == pytest.approx(2.0 * COULOMB / GAIN, rel=1e-12)
    assert current_A[890] == np.abs(current_A).max()
    assert current_A[1290] == pytest.approx(current_A[290], rel=1e-3)


def test_parameters_that_are_none_are_refused() -> None:
    """A bandwidth of zero, an overdamped estimator."""
    with pytest.raises(ValueError, match="bandwidth"):
        PiDragEstimator(0.0)
    with pytest.raises(ValueError, match="damping"):
        PiDragEstimator(CASSINI_RAD_S, 1.0)
    assert math.isclose(CASSINI_RAD_S, 0.0628318, rel_tol=1e-6)
