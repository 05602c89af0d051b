"""Sliding mode keeps to its boundary layer while friction keeps to its bound."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rw_ekf.control.compensation.sliding_mode import SlidingMode, SlidingSurface
from tests.control.compensation.bare_wheel import COULOMB, GAIN, BareWheel, coulomb

SURFACE = SlidingSurface(layer_rad_s=0.5, slope_rad_s=0.5, reach=2.0)


def friction_of(seed: int, most: float):  # type: ignore[no-untyped-def]
    """Any friction below a bound: it steps and swings at random."""
    draw = np.random.default_rng(seed)
    levels, rates = draw.uniform(0.0, most, 200), draw.uniform(0.1, 9.0, 3)
    return lambda t, speed: float(levels[int(t / 0.4) % 200] * (0.5 + 0.5 * math.sin(rates[seed % 3] * t + speed)))


@pytest.mark.parametrize("seed", range(8))
def test_the_surface_is_never_left_for_friction_within_the_bound(seed: int) -> None:
    """|s| <= phi, through reversals; a hundredth of a second of sampling may add what friction does in that time."""
    eta = SURFACE.reach * COULOMB
    scheme, wheel = (
        SlidingMode(GAIN, COULOMB, SURFACE),
        BareWheel(friction_of(seed, 0.95 * eta), speed=5.0, period_s=0.01),
    )
    for _ in range(4000):
        wheel.run(scheme, lambda t: 2.0 * math.cos(0.4 * t), 0.01)
        assert abs(scheme.s_rad_s) <= SURFACE.layer_rad_s + 0.01 * 2.0 * eta


def test_friction_beyond_the_bound_leaves_it() -> None:
    """The bound is what holds it, and nothing else."""
    scheme, wheel = SlidingMode(GAIN, COULOMB, SURFACE), BareWheel(coulomb(2.5 * COULOMB), speed=40.0, period_s=0.01)
    wheel.run(scheme, lambda t: 0.0, 10.0)
    assert abs(scheme.s_rad_s) > 1.2 * SURFACE.layer_rad_s


def test_constant_friction_costs_no_speed_in_the_end() -> None:
    """The integral in the surface holds it: s stands where eta s / phi is the friction, and e is zero."""
    scheme, wheel = SlidingMode(GAIN, COULOMB, SURFACE), BareWheel(coulomb(), speed=30.0)
    wheel.run(scheme, lambda t: 0.0, 40.0)
    assert wheel.speed == pytest.approx(30.0, abs=1e-3)
    assert scheme.s_rad_s == pytest.approx(-SURFACE.layer_rad_s / SURFACE.reach, rel=1e-3)


def test_a_gap_makes_no_jump() -> None:
    """The reference is the speed that is found; s, which holds the friction, stays."""
    scheme, wheel = SlidingMode(GAIN, COULOMB, SURFACE), BareWheel(coulomb(), speed=30.0)
    wheel.run(scheme, lambda t: 0.0, 40.0)
    before = wheel.current_A
    wheel.time_s += 100.0
    wheel.speed = -7.0
    assert scheme.current_A(wheel.tick(), 0.0, wheel.known()) == pytest.approx(before, rel=1e-3)
