"""The friction law and the drift, per unit inertia: scalar functions importing only `math` (docs/model.md eq. 1-6).

With v = sigma * omega >= 0 the speed in the direction of motion (sigma = +1 or -1) and push = sigma * drive,

    dv/dt = push - b v - [c + (s - c) g(v / omega_s)]                                       [CK13 (1), (4); F12 (3)]

where drive = k I. Written in v every branch is smooth through zero, so that a Runge-Kutta stage may look past the
stop; which branch holds, and whether the wheel moves at all, is decided in `propagation`.

Units: speeds rad/s, drive and c and s rad/s^2, b 1/s, omega_s rad/s. Plain and compiled, these same functions run.
"""

import math
from typing import NamedTuple

GAUSS = 0  # exp(-u^2)      [CK13 (1)]
TUSTIN = 1  # exp(-|u|)      [F12, introduction]
LORENTZ = 2  # 1 / (1 + u^2)  [F12, introduction]
LAW_CODES = {"gauss": GAUSS, "tustin": TUSTIN, "lorentz": LORENTZ}
LAW_NAMES = {code: name for name, code in LAW_CODES.items()}

# In Stribeck speeds: beyond the first the Stribeck term has no slope left to speak of (Gauss: 2e-16) and the wheel is
# fast; below the second it creeps, and its friction is not known better than by half of c.
FAST_STRIBECK_SPEEDS = 6.0
CREEP_STRIBECK_SPEEDS = 3.0


class Stribeck(NamedTuple):
    """How dry friction falls with speed: the Stribeck speed [rad/s] and the law's code."""

    omega_s: float
    law: int


class FrictionCurve(NamedTuple):
    """Friction against speed, per unit inertia: what a flow under a constant drive goes by."""

    b: float  # 1/s
    c: float  # rad/s^2
    s: float  # rad/s^2
    omega_s: float  # rad/s
    law: int


# Beyond this many Stribeck speeds g is below 3e-16 and the drift is linear in v. Lorentz's tail never ends.
_FAR_GAUSS = FAST_STRIBECK_SPEEDS
_FAR_TUSTIN = 36.0
_FAR_LORENTZ = 1.0e300


def far_limit(law: int) -> float:
    """Multiple of the Stribeck speed beyond which the Stribeck term is zero to double precision [-]."""
    if law == GAUSS:
        return _FAR_GAUSS
    if law == TUSTIN:
        return _FAR_TUSTIN
    return _FAR_LORENTZ


def stribeck(u: float, law: int) -> float:
    """g(u), 1 at rest and falling to 0 [-]; u = v / omega_s [-]."""
    if law == GAUSS:
        return math.exp(-u * u) if u * u < 700.0 else 0.0
    if law == TUSTIN:
        return math.exp(-u) if u < 700.0 else 0.0
    return 1.0 / (1.0 + u * u)


def stribeck_slope(u: float, g: float, law: int) -> float:
    """Slope dg/du [-], from u and g = stribeck(u, law)."""
    if law == GAUSS:
        return -2.0 * u * g
    if law == TUSTIN:
        return -g
    return -2.0 * u * g * g


def friction(v: float, b: float, c: float, s: float, omega_s: float, law: int) -> float:
    """Friction deceleration at directional speed v >= 0 [rad/s^2]: b v + c + (s - c) g(v/omega_s)  [CK13 (1)]."""
    return b * v + c + (s - c) * stribeck(v / omega_s, law)


def acceleration(omega: float, drive: float, b: float, c: float, s: float, omega_s: float, law: int) -> float:
    """Acceleration d omega/dt [rad/s^2] of a wheel at speed omega, stick included: 0 at rest while |drive| <= s.

    [CK13 (4); F12 (3)]; at rest the sign is that of the drive, because the wheel is about to move that way.
    """
    if omega == 0.0:
        if abs(drive) <= max(s, 0.0):
            return 0.0
        return drive - math.copysign(s, drive)
    sigma = math.copysign(1.0, omega)
    return drive - sigma * friction(sigma * omega, b, c, s, omega_s, law)
