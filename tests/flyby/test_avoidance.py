"""Rates that keep wheels from zero near closest approach do so, and those beside them do not."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rw_ekf.flyby.avoidance import Family, allowed_values, null_family, scaled_family
from rw_ekf.flyby.geometry import Flyby
from rw_ekf.flyby.wheel_rates import rates_at
from tests.flyby.geometries import random_flyby, random_rates


def is_free(flyby: Flyby, family: Family, value: float, within_s: float) -> bool:
    """Whether no wheel is at zero or changes its sign on a grid of angles around closest approach."""
    closest = flyby.closest_approach_s
    first = max(flyby.start_rad, flyby.angle_rad(closest - within_s))
    last = min(flyby.end_rad, flyby.angle_rad(closest + within_s))
    if first >= last:
        return True  # the window ends before, or begins after
    angles = np.linspace(first, last, 4001)
    rates = rates_at(family.base, angles) + value * rates_at(family.direction, angles)
    signs = np.where(np.abs(rates) > 1e-9, np.sign(rates), 0.0)  # rates of wheels that start at rest are zero there
    return bool(np.all(np.abs(signs.sum(axis=1)) == angles.size))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(3, 5), st.floats(0.05, 2.0), st.booleans())
def test_inside_is_free_and_outside_is_not(seed: int, wheels: int, share: float, null: bool) -> None:
    """Values well inside an allowed interval keep every wheel from zero; values between the intervals do not."""
    flyby = random_flyby(seed, wheels)
    rates = random_rates(flyby, seed)
    within_s = share * flyby.closest_approach_s
    family = null_family(flyby, rates) if null else scaled_family(flyby, rates)
    if family is None:
        assert wheels != 4
        return
    allowed = allowed_values(flyby, family, within_s)
    reach = 5.0 + 5.0 * max((abs(x) for pair in allowed for x in pair if math.isfinite(x)), default=1.0)
    edges = [-reach, *(x for pair in allowed for x in pair if math.isfinite(x)), reach]
    for low, high in itertools.pairwise(edges):
        if high - low < 1e-3 * reach:
            continue
        for value in np.linspace(low, high, 7)[1:-1]:
            inside = any(a < value < b for a, b in allowed)
            assert is_free(flyby, family, float(value), within_s) == inside, (value, allowed)


def test_a_window_that_does_not_come_near_allows_everything() -> None:
    """A window that ends long before closest approach has nothing to avoid there."""
    flyby = random_flyby(5, 4)
    early = Flyby(flyby.wheels, flyby.inertia_kg_m2, flyby.slew_axis, flyby.miss_distance_m, flyby.speed_m_s, 0.2, 0.5)
    family = scaled_family(early, random_rates(early, 5))
    assert allowed_values(early, family, 1.0) == [(-math.inf, math.inf)]


def test_the_null_vector_moves_no_body() -> None:
    """Along the null space of four wheels no momentum reaches the body; with three or five there is no such line."""
    flyby = random_flyby(6, 4)
    family = null_family(flyby, random_rates(flyby, 6))
    assert family is not None
    spin = np.array([rate.mean for rate in family.direction]) * flyby.wheels.inertia_kg_m2
    assert np.linalg.norm(flyby.wheels.axes @ spin) == pytest.approx(0.0, abs=1e-12)
    assert null_family(random_flyby(6, 3), [1.0] * 3) is None
    assert null_family(random_flyby(6, 5), [1.0] * 5) is None
