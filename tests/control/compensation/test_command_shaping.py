"""The parabola meets its three conditions; what is shaped is continuous where friction is not."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.control.compensation.command_shaping import CommandShaping, Parabola
from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.records import WheelSample
from tests.control.compensation.bare_wheel import STRIBECK
from tests.ticks import tick_of

WIDTH = 1.5


def known_at(speed_rad_s: float) -> WheelKnown:
    """What a filter says of a wheel at a speed [rad/s]."""
    return WheelKnown.of_parameters(speed_rad_s, CK13_STATISTICAL, STRIBECK)


def test_the_three_coefficients_solve_the_three_boundary_conditions() -> None:
    """Zero at rest, friction and slope at the width: against the linear system of equations."""
    friction, slope = 0.59, 0.02
    conditions = np.array([[1.0, 0.0, 0.0], [1.0, WIDTH, WIDTH**2], [0.0, 1.0, 2.0 * WIDTH]])
    solved = np.linalg.solve(conditions, [0.0, friction, slope])
    assert Parabola.shaping(WIDTH, friction, slope) == pytest.approx(tuple(solved), abs=1e-12)


def test_what_is_shaped_is_odd_continuous_everywhere_and_smooth_at_the_width() -> None:
    """Friction itself jumps by 2 c at rest."""
    scheme, friction = CommandShaping(WIDTH), known_at(1.0).friction_rad_s2
    speed = np.linspace(-3.0, 3.0, 60001)
    shaped = np.array([scheme.shaped(v, friction) for v in speed])
    assert np.abs(np.diff(shaped)).max() < 1e-3 < np.abs(np.diff([friction(v) for v in speed])).max()
    assert shaped == pytest.approx(-shaped[::-1], abs=1e-12)
    for edge in (WIDTH, -WIDTH):
        below, above = ((scheme.shaped(edge + d, friction) - scheme.shaped(edge, friction)) / d for d in (-1e-5, 1e-5))
        assert below == pytest.approx(above, rel=1e-2)


def test_beyond_the_width_it_is_the_friction_of_the_model() -> None:
    """The current is that of the request and the whole friction."""
    known = known_at(-2.0)
    current_A = CommandShaping(WIDTH).current_A(tick_of(WheelSample(0.0, -2.0)), 0.3, known)
    assert current_A * CK13_STATISTICAL.motor_gain == pytest.approx(0.3 + known.friction_rad_s2(-2.0), rel=1e-12)


def test_a_width_of_nothing_is_refused() -> None:
    """There is no parabola then."""
    with pytest.raises(ValueError, match="width"):
        CommandShaping(0.0)
