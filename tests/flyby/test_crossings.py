"""Every crossing and every touch is found, and nothing else."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rw_ekf.flyby.geometry import Flyby
from rw_ekf.flyby.settings import read_flyby
from rw_ekf.flyby.wheel_rates import WheelRate, course_of, rates_at, wheel_rates
from tests.flyby.geometries import flybys, random_rates


@settings(max_examples=100, deadline=None)
@given(flybys, st.integers(0, 10_000), st.floats(0.1, 100.0))
def test_crossings_are_the_changes_of_sign_on_a_fine_grid(flyby: Flyby, seed: int, size_rad_s: float) -> None:
    """For random wheels: as many crossings as a grid of 20000 angles shows, each where it shows it, none beside."""
    angles = np.linspace(flyby.start_rad, flyby.end_rad, 20_001)
    rates = wheel_rates(flyby, random_rates(flyby, seed, size_rad_s))
    for rate, values in zip(rates, rates_at(rates, angles), strict=True):
        course = course_of(flyby, rate)
        seen = np.flatnonzero(values[:-1] * values[1:] < 0.0)
        found = [flyby.angle_rad(crossing.time_s) for crossing in course.crossings]
        closer = [b - a for a, b in itertools.pairwise(found)]
        if closer and min(closer) < 2.0 * (angles[1] - angles[0]):
            continue  # the grid cannot tell two so close
        assert len(found) == seen.size
        for angle, index in zip(found, seen, strict=True):
            assert angles[index] - 1e-9 <= angle <= angles[index + 1] + 1e-9
        assert course.ends_reversed == (len(found) % 2 == 1)
        if not found and not course.touches_s:
            assert course.slowest_rad_s == pytest.approx(float(np.min(np.abs(values))), rel=1e-3, abs=1e-6)


@settings(max_examples=50, deadline=None)
@given(flybys, st.integers(0, 10_000))
def test_the_rate_of_a_crossing_is_that_of_the_wheel(flyby: Flyby, seed: int) -> None:
    """At a crossing the rate is zero, and changes as a central difference over time says."""
    for rate in wheel_rates(flyby, random_rates(flyby, seed)):
        for crossing in course_of(flyby, rate).crossings:
            step = 1e-4 * flyby.duration_s
            before, at, after = (
                rate(flyby.angle_rad(time_s))
                for time_s in (crossing.time_s - step, crossing.time_s, crossing.time_s + step)
            )
            assert abs(at) < 1e-9 * rate.scale
            assert crossing.rate_rad_s2 == pytest.approx(
                (after - before) / (2 * step), abs=1e-4 * rate.scale / step / 100
            )


@pytest.mark.parametrize("at_rad", [0.8, 1.5708, 2.0])
def test_a_touch_is_not_missed_and_not_called_a_crossing(at_rad: float) -> None:
    """1 - cos(alpha - a) touches zero at a; a little lower it crosses twice, a little higher not at all."""
    flyby = read_flyby()
    touching = WheelRate(50.0, -50.0 * math.cos(at_rad), -50.0 * math.sin(at_rad), 0.0)
    course = course_of(flyby, touching)
    assert course.crossings == ()
    assert course.touches_s == pytest.approx((flyby.time_s(at_rad),), abs=1e-3)
    assert course.slowest_rad_s == 0.0
    for lower, crossings in ((1e-5, 2), (-1e-5, 0)):
        near = course_of(flyby, WheelRate(50.0 - lower, touching.cosine, touching.sine, 0.0))
        assert len(near.crossings) == crossings
        assert near.touches_s == ()
        assert near.slowest_s == pytest.approx(flyby.time_s(at_rad), abs=2.0)
        assert not near.ends_reversed


def test_a_crossing_without_a_slope_is_one_crossing() -> None:
    """A threefold zero: value, slope and curvature vanish at one angle, and the sign changes there."""
    flyby, at = read_flyby(), 1.1
    rows = [[-math.sin(at), math.cos(at)], [-math.cos(at), -math.sin(at)]]
    cosine, sine = np.linalg.solve(rows, [2.0 * math.sin(2.0 * at), 4.0 * math.cos(2.0 * at)])
    mean = -(cosine * math.cos(at) + sine * math.sin(at) + math.cos(2.0 * at))
    course = course_of(flyby, WheelRate(mean, float(cosine), float(sine), 1.0))
    (crossing,) = course.crossings
    assert crossing.time_s == pytest.approx(flyby.time_s(at), abs=1.0)
    assert crossing.rate_rad_s2 == pytest.approx(0.0, abs=1e-9)
    assert course.touches_s == ()


def test_a_wheel_that_starts_at_zero_touches_there_and_may_still_cross() -> None:
    """cos(alpha) - cos(alpha0) starts at zero and does not come back; a constant zero touches at both ends."""
    flyby = read_flyby()
    leaving = course_of(flyby, WheelRate(-math.cos(flyby.start_rad), 1.0, 0.0, 0.0))
    assert (leaving.crossings, leaving.touches_s) == ((), (0.0,))
    resting = course_of(flyby, WheelRate(0.0, 0.0, 0.0, 0.0))
    assert resting.touches_s == pytest.approx((0.0, flyby.duration_s))
