"""Wheel rates along a flyby, in closed form, and where they cross zero.

A rate is a trigonometric polynomial of degree two in alpha for each wheel. Every place of the window at which it
crosses zero or touches it is found, however close two may be.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Complex128Array, Float64Array
from rw_ekf.flyby.geometry import Flyby

_NOTHING = 1.0e-14  # of the largest coefficient


@dataclass(frozen=True)
class WheelRate:
    """One wheel's rate [rad/s]: mean + cosine cos(alpha) + sine sin(alpha) + second cos(2 alpha)."""

    mean: float
    cosine: float
    sine: float
    second: float

    def __call__(self, angle_rad: float) -> float:
        """Rate [rad/s] at alpha."""
        return (
            self.mean
            + self.cosine * math.cos(angle_rad)
            + self.sine * math.sin(angle_rad)
            + self.second * math.cos(2.0 * angle_rad)
        )

    def slope(self, angle_rad: float) -> float:
        """Change of the rate with alpha [rad/s per rad]."""
        return (
            -self.cosine * math.sin(angle_rad)
            + self.sine * math.cos(angle_rad)
            - 2.0 * self.second * math.sin(2.0 * angle_rad)
        )

    @property
    def scale(self) -> float:
        """A bound on the rate's size [rad/s]."""
        return abs(self.mean) + abs(self.cosine) + abs(self.sine) + abs(self.second)

    @property
    def fourier(self) -> Complex128Array:
        """Coefficients (5,) of z^2 to z^-2, z = exp(i alpha)."""
        first = 0.5 * complex(self.cosine, -self.sine)
        return np.array([0.5 * self.second, first, self.mean, first.conjugate(), 0.5 * self.second])

    def stationary_rad(self, start_rad: float, end_rad: float) -> list[float]:
        """Angles between start and end at which the rate can be stationary, ascending."""
        return root_angles(derivative(self.fourier), start_rad, end_rad)


def derivative(fourier: Complex128Array) -> Complex128Array:
    """Coefficients of the derivative of a trigonometric polynomial, highest power of z first."""
    degree = fourier.size // 2
    return 1j * np.arange(degree, -degree - 1, -1) * fourier


def root_angles(fourier: Complex128Array, start_rad: float, end_rad: float) -> list[float]:
    """Angles between start and end that hold every zero of a trigonometric polynomial, ascending.

    Zeros are roots on the unit circle. The arguments of all roots are taken: rounding moves a double one off the
    circle, and those that never were on it do no harm to whoever only divides the window at these angles.
    """
    largest = float(np.max(np.abs(fourier)))
    if largest == 0.0:
        return []
    while abs(fourier[0]) < _NOTHING * largest:  # conjugate ends: both go
        fourier = fourier[1:-1]
    angles = np.angle(np.roots(fourier)) % (2.0 * math.pi)
    return sorted(float(angle) for angle in angles if start_rad < angle < end_rad)


def wheel_rates(flyby: Flyby, rates_rad_s: Sequence[float]) -> tuple[WheelRate, ...]:
    """Rates of all wheels from their rates (n,) at the start: (A4), its last term added.

    Total momentum is conserved in inertial space, H0 = A h0 + I n w0 with wheel momenta h and the slew axis n, and is
    seen from the body turned back by beta = alpha - alpha0. The wheels hold what the body does not,
    h = A+ (Q' H0 - I n w), and, with more than three, their null-space part as it was: torques are allocated by the
    pseudo-inverse A+.
    """
    wheels, n = flyby.wheels, flyby.slew_axis
    start = wheels.inertia_kg_m2 * np.asarray(rates_rad_s, dtype=np.float64)
    body = flyby.inertia_kg_m2 @ n  # momentum per rate
    total = wheels.axes @ start + body * flyby.rate_rad_s(flyby.start_rad)
    along, turned = n * (n @ total), np.cross(n, total)
    across = total - along
    cosine, sine = math.cos(flyby.start_rad), math.sin(flyby.start_rad)
    half = 0.5 * flyby.peak_rate_rad_s * body  # sin^2 = (1 - cos 2)/2
    terms = np.column_stack([along - half, cosine * across + sine * turned, sine * across - cosine * turned, half])
    momenta = wheels.allocation @ terms
    momenta[:, 0] += wheels.null_projection @ start
    return tuple(WheelRate(*map(float, row)) for row in momenta / wheels.inertia_kg_m2[:, None])


def rates_at(rates: Sequence[WheelRate], angles_rad: Float64Array) -> Float64Array:
    """Rates [rad/s] of n wheels at m angles, (n, m)."""
    a = angles_rad
    basis = np.stack([np.ones_like(a), np.cos(a), np.sin(a), np.cos(2.0 * a)])
    terms = np.array([[rate.mean, rate.cosine, rate.sine, rate.second] for rate in rates])
    return np.asarray(terms @ basis, dtype=np.float64)


_ZERO = 1.0e-9  # of the rate's scale: no flyby is known to a billionth


@dataclass(frozen=True)
class Crossing:
    """One change of sign."""

    time_s: float
    rate_rad_s2: float  # of change


@dataclass(frozen=True)
class WheelCourse:
    """What one wheel does in the window."""

    start_rad_s: float
    end_rad_s: float
    crossings: tuple[Crossing, ...]
    touches_s: tuple[float, ...]  # zero without a change of sign, the two ends of the window included
    slowest_rad_s: float  # least size of the rate; zero where it crosses or touches
    slowest_s: float

    @property
    def ends_reversed(self) -> bool:
        """The criterion of [L17] (C1, C2, C4 < 0 or > 0): the rate at the end has the other sign, so it crosses.

        Where it is False the number of crossings is even: none, or two.
        """
        return self.start_rad_s * self.end_rad_s < 0.0


def course_of(flyby: Flyby, rate: WheelRate) -> WheelCourse:
    """Follow one wheel through the window.

    Between two neighbouring stationary points the rate is monotonic, so one change of sign there is one crossing.
    """
    from scipy.optimize import brentq

    start, end = flyby.start_rad, flyby.end_rad
    angles = [start, *rate.stationary_rad(start, end), end]
    signs = [_sign(rate(angle), rate.scale) for angle in angles]
    crossings: list[float] = []
    touches: list[float] = []
    last = 0  # the last sign that was not zero
    zeros: list[float] = []  # stationary points at zero since then
    before = start
    for angle, sign in zip(angles, signs, strict=True):
        if sign == 0:
            zeros.append(angle)
            continue
        if last * sign < 0:
            crossings.append(zeros[0] if zeros else float(brentq(rate, before, angle, xtol=1e-14)))
        elif zeros:
            touches.append(zeros[0])
        last, zeros, before = sign, [], angle
    if zeros:
        touches += zeros if last == 0 else zeros[:1]  # at zero all the way, or up to the end
    slowest = min((abs(rate(angle)), angle) for angle in [*angles, *crossings, *touches])
    return WheelCourse(
        rate(start),
        rate(end),
        tuple(Crossing(flyby.time_s(angle), rate.slope(angle) * flyby.rate_rad_s(angle)) for angle in crossings),
        tuple(flyby.time_s(angle) for angle in touches),
        0.0 if crossings or touches else slowest[0],
        flyby.time_s(slowest[1]),
    )


def _sign(value: float, scale: float) -> int:
    return 0 if abs(value) <= _ZERO * scale else 1 if value > 0.0 else -1
