"""The closed form against physics integrated another way, for any wheels, any inertia and any slew axis."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from rw_ekf.arrays import Float64Array
from rw_ekf.flyby.geometry import Flyby
from rw_ekf.flyby.wheel_rates import WheelRate, wheel_rates
from tests.flyby.geometries import flybys, random_flyby, random_rates

seeds = st.integers(0, 10_000)


def integrated(flyby: Flyby, rates_rad_s: list[float], times_s: Float64Array) -> Float64Array:
    """alpha of (A3) and the wheel rates of Euler's equation (n + 1, m), torques allocated by the pseudo-inverse."""
    inertia, n, wheels = flyby.inertia_kg_m2, flyby.slew_axis, flyby.wheels
    share = np.linalg.pinv(wheels.axes)
    swing = flyby.speed_m_s / flyby.miss_distance_m

    def change(_time_s: float, y: Float64Array) -> Float64Array:
        alpha, momenta = y[0], wheels.axes @ (wheels.inertia_kg_m2 * y[1:])
        rate = swing * math.sin(alpha) ** 2
        acceleration = swing * math.sin(2.0 * alpha) * rate
        torque = inertia @ n * acceleration + np.cross(n * rate, inertia @ n * rate + momenta)
        return np.concatenate([[rate], -(share @ torque) / wheels.inertia_kg_m2])

    start = np.array([flyby.start_rad, *rates_rad_s])
    span = (0.0, float(times_s[-1]))
    return np.asarray(solve_ivp(change, span, start, "DOP853", times_s, rtol=1e-11, atol=1e-9).y)


@settings(max_examples=25, deadline=None)
@given(flybys, seeds)
def test_the_closed_form_is_what_euler_s_equation_gives(flyby: Flyby, seed: int) -> None:
    """Angle and rates along the window, three to six wheels: an integration of torques, not of conserved momentum."""
    rates = random_rates(flyby, seed)
    times_s = np.linspace(0.0, flyby.duration_s, 9)
    y = integrated(flyby, rates, times_s)
    closed = wheel_rates(flyby, rates)
    for column, time_s in enumerate(times_s):
        angle = flyby.angle_rad(float(time_s))
        np.testing.assert_allclose(angle, y[0, column], atol=1e-8)
        scale = max(rate.scale for rate in closed)
        np.testing.assert_allclose([rate(angle) for rate in closed], y[1:, column], rtol=0.0, atol=1e-7 * scale)


@settings(max_examples=50, deadline=None)
@given(flybys, seeds)
def test_momentum_is_conserved_in_inertial_space(flyby: Flyby, seed: int) -> None:
    """Body and wheels together, turned into the frame of the start by scipy's rotations, at any angle."""
    wheels = flyby.wheels
    rates = wheel_rates(flyby, random_rates(flyby, seed))

    def momentum(angle: float) -> Float64Array:
        spin = wheels.inertia_kg_m2 * np.array([rate(angle) for rate in rates])
        body = flyby.inertia_kg_m2 @ flyby.slew_axis * flyby.rate_rad_s(angle) + wheels.axes @ spin
        turned = Rotation.from_rotvec((angle - flyby.start_rad) * flyby.slew_axis).apply(body)
        return np.asarray(turned, dtype=np.float64)

    begin = momentum(flyby.start_rad)
    for angle in np.linspace(flyby.start_rad, flyby.end_rad, 11):
        np.testing.assert_allclose(momentum(float(angle)), begin, rtol=0.0, atol=1e-9 * (1.0 + math.hypot(*begin)))


@settings(max_examples=50, deadline=None)
@given(flybys, seeds, seeds)
def test_rates_at_the_start_superpose(flyby: Flyby, one: int, other: int) -> None:
    """What two sets of rates change adds up, and the closed form starts at the rates that it was given."""
    first, second = random_rates(flyby, one), random_rates(flyby, other)
    both = [a + b for a, b in zip(first, second, strict=True)]
    sets = [wheel_rates(flyby, rates) for rates in (first, second, both, [0.0] * len(first))]
    for a, b, c, none in zip(*sets, strict=True):
        for angle in (flyby.start_rad, 1.0, flyby.end_rad):
            assert math.isclose(a(angle) + b(angle) - none(angle), c(angle), abs_tol=1e-9 * (a.scale + b.scale))
    np.testing.assert_allclose([rate(flyby.start_rad) for rate in sets[0]], first, atol=1e-8)


def test_the_null_space_of_four_wheels_stays_as_it_is() -> None:
    """A bias that the body does not feel is there, unchanged, to the end."""
    flyby = random_flyby(3, 4)
    _, _, rows = np.linalg.svd(flyby.wheels.axes)
    bias = 20.0 * rows[3] / flyby.wheels.inertia_kg_m2
    rates = random_rates(flyby, 4)
    with_bias = wheel_rates(flyby, (np.array(rates) + bias).tolist())
    for rate, biased, added in zip(wheel_rates(flyby, rates), with_bias, bias, strict=True):
        for angle in (flyby.start_rad, 1.5, flyby.end_rad):
            assert math.isclose(biased(angle) - rate(angle), added, abs_tol=1e-8)


@settings(max_examples=50, deadline=None)
@given(flybys, st.floats(0.0, 1.0))
def test_time_and_angle_are_inverses(flyby: Flyby, share: float) -> None:
    """cot(alpha) = cot(alpha0) - V t/(h+R) both ways; a right angle at closest approach."""
    angle = flyby.start_rad + share * (flyby.end_rad - flyby.start_rad)
    assert math.isclose(flyby.angle_rad(flyby.time_s(angle)), angle, abs_tol=1e-11)
    assert math.isclose(flyby.angle_rad(flyby.closest_approach_s), 0.5 * math.pi, abs_tol=1e-11)


def test_the_slope_is_the_derivative() -> None:
    """Against a central difference."""
    rate = WheelRate(1.0, -2.0, 3.0, 0.7)
    for angle in (0.3, 1.1, 2.6):
        assert math.isclose(rate.slope(angle), (rate(angle + 1e-6) - rate(angle - 1e-6)) / 2e-6, abs_tol=1e-7)
