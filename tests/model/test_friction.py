"""The friction law: against the printed equations, and in its limits."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from rw_ekf.model.friction import GAUSS, LAW_CODES, LORENTZ, TUSTIN, acceleration, far_limit, stribeck, stribeck_slope
from tools.measure.runs import OMEGA_S

B, C, S = 0.00322, 0.5863, 0.6037
CURRENT_A, MOTOR_GAIN = 0.05, 15.205


def drift(omega: float, k: float, b: float, c: float, s: float) -> float:
    return acceleration(omega, k * CURRENT_A, b, c, s, OMEGA_S, GAUSS)


@pytest.mark.parametrize("omega", [-30.0, -0.4, -0.05, 0.02, 0.3, 1.0, 50.0])
def test_the_drift_is_equation_4_of_ck13_written_out(omega: float) -> None:
    """At any speed the drift equals [CK13 (4)] typed in from the paper."""
    printed = MOTOR_GAIN * CURRENT_A - B * omega
    printed -= math.copysign(1.0, omega) * (C + (S - C) * math.exp(-(omega**2) / OMEGA_S**2))
    assert drift(omega, MOTOR_GAIN, B, C, S) == pytest.approx(printed, rel=1e-13)


@pytest.mark.parametrize("omega", [-30.0, -0.4, -0.05, 0.02, 0.3, 1.0, 50.0])
def test_differences_of_the_drift_are_the_printed_jacobian(omega: float) -> None:
    """Central differences of the drift give [F12 (10)-(14)], the five partial derivatives of the papers."""
    sign, g = math.copysign(1.0, omega), math.exp(-((omega / OMEGA_S) ** 2))
    printed = (
        -B + 2.0 * omega / OMEGA_S / OMEGA_S * sign * (S - C) * g,  # (10)
        CURRENT_A,  # (11)
        -omega,  # (12)
        -sign * (1.0 - g),  # (13)
        -sign * g,  # (14)
    )
    at = (omega, MOTOR_GAIN, B, C, S)
    for j, value in enumerate(printed):
        h = 1e-6
        up, down = list(at), list(at)
        up[j] += h
        down[j] -= h
        assert (drift(*up) - drift(*down)) / (2.0 * h) == pytest.approx(value, rel=1e-7, abs=2e-9)


@pytest.mark.parametrize("law", LAW_CODES.values())
def test_the_stribeck_curve_falls_from_one_to_zero_with_the_slope_given(law: int) -> None:
    """Every law is 1 at rest, falls monotonically, and its slope is its derivative."""
    assert stribeck(0.0, law) == 1.0
    grid = [0.05 * i for i in range(1, 100)]
    values = [stribeck(u, law) for u in grid]
    assert all(a > b for a, b in pairwise(values))
    for u, g in zip(grid, values, strict=True):
        h = 1e-6
        numeric = (stribeck(u + h, law) - stribeck(u - h, law)) / (2.0 * h)
        assert stribeck_slope(u, g, law) == pytest.approx(numeric, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("law", [GAUSS, TUSTIN])
def test_beyond_the_far_limit_the_stribeck_term_is_below_rounding(law: int) -> None:
    """Where the closed form takes over, what it leaves out is less than 3e-16 of (s - c)."""
    assert stribeck(far_limit(law), law) < 3e-16


def test_a_lorentz_tail_is_never_left_out() -> None:
    """Lorentz falls as 1/u^2 only, so that no wheel's speed is ever far."""
    assert far_limit(LORENTZ) > 1e100
    assert stribeck(100.0, LORENTZ) == pytest.approx(1e-4, rel=1e-3)


@pytest.mark.parametrize("law", LAW_CODES.values())
def test_the_curve_is_finite_at_any_speed(law: int) -> None:
    """No speed overflows the exponential: far away it is exactly zero or tiny."""
    for u in (26.0, 27.0, 700.0, 1e6, 1e150):
        assert 0.0 <= stribeck(u, law) < 2e-3


@pytest.mark.parametrize(
    ("drive", "expected"), [(0.0, 0.0), (0.6, 0.0), (-0.6, 0.0), (S, 0.0), (0.7, 0.7 - S), (-0.7, S - 0.7)]
)
def test_a_wheel_at_rest_moves_only_beyond_the_break_away_friction(drive: float, expected: float) -> None:
    """At rest nothing happens while |drive| <= s; beyond it the excess accelerates the wheel the drive's way."""
    assert acceleration(0.0, drive, B, C, S, OMEGA_S, GAUSS) == pytest.approx(expected)
