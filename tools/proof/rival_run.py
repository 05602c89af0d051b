"""A free run of the rivals' own: explicit steps with dry friction and rest, sharing no line with the estimator.

Between two rows the acceleration is `e + h omega - F(|omega|) sgn(omega)`: e and h belong to the row (drive, angle,
temperature and time enter there), F is a friction for each direction, tabulated over the speed. A wheel at rest stays
there while e is within what friction holds; where a step would cross zero, it stops at zero and is asked again.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from rw_ekf.arrays import BoolArray, Float64Array, by_identity

GRID = 2001  # speeds of a friction table
_LONGEST_S, _FEWEST, _MOST = 2.5e-3, 4, 12  # of a step, and how many between two rows
_FAR = 20.0  # top speeds: a run that is further away has run off, and stays there


@by_identity
class Driven(NamedTuple):
    """What acts between a row and the next, (n,) each: for `early_s` by the drive before, then by the row's own."""

    step_s: Float64Array  # 0 from the last row of a stretch on
    early_s: Float64Array
    early: Float64Array  # e [rad/s^2]
    late: Float64Array
    early_slope: Float64Array  # h [1/s]
    late_slope: Float64Array


@by_identity
class Friction(NamedTuple):
    """Friction over |omega| from 0 to top [rad/s^2], (GRID,), for each direction.

    Beyond the top it goes on as a straight line that does not fall: else a run that gets there runs off.
    """

    top_rad_s: float
    forward: Float64Array
    backward: Float64Array


@njit(cache=True)  # type: ignore[untyped-decorator]
def _at(table: Float64Array, top: float, size: float) -> float:
    place = size / top * (table.size - 1)
    cell = min(int(place), table.size - 2)
    slope = table[cell + 1] - table[cell]
    if place > table.size - 1:
        return float(table[-1] + (place - table.size + 1) * max(slope, 0.0))
    return float(table[cell] + (place - cell) * slope)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _rate(omega: float, e: float, h: float, top: float, forward: Float64Array, backward: Float64Array) -> float:
    if omega > 0.0:
        return float(e + h * omega - _at(forward, top, omega))
    return float(e + h * omega + _at(backward, top, -omega))


@njit(cache=True)  # type: ignore[untyped-decorator]
def _advanced(
    omega: float, e: float, h: float, seconds: float, top: float, forward: Float64Array, backward: Float64Array
) -> float:
    """Speed after so long under constant e and h, by Heun's rule."""
    if seconds <= 0.0:
        return omega
    steps = min(max(_FEWEST, math.ceil(seconds / _LONGEST_S)), _MOST)
    step = seconds / steps
    for _ in range(steps):
        if omega == 0.0:
            if e > forward[0]:
                rate = e - forward[0]
            elif e < -backward[0]:
                rate = e + backward[0]
            else:
                continue
            omega = step * rate
            continue
        first = _rate(omega, e, h, top, forward, backward)
        guess = omega + step * first
        if guess * omega <= 0.0:
            omega = 0.0
            continue
        second = _rate(guess, e, h, top, forward, backward)
        new = omega + 0.5 * step * (first + second)
        omega = 0.0 if new * omega <= 0.0 else min(max(new, -_FAR * top), _FAR * top)
    return omega


@njit(cache=True)  # type: ignore[untyped-decorator]
def _run(
    step_s: Float64Array, early_s: Float64Array, early: Float64Array, late: Float64Array, early_slope: Float64Array,
    late_slope: Float64Array, top: float, forward: Float64Array, backward: Float64Array, begins: BoolArray,
    start: Float64Array, out: Float64Array,
) -> None:  # fmt: skip
    omega = 0.0
    for i in range(step_s.size):
        if begins[i]:
            omega = start[i]
        out[i] = omega
        omega = _advanced(omega, early[i], early_slope[i], early_s[i], top, forward, backward)
        omega = _advanced(omega, late[i], late_slope[i], step_s[i] - early_s[i], top, forward, backward)


def run(driven: Driven, friction: Friction, begins: BoolArray, start_rad_s: Float64Array) -> Float64Array:
    """Speeds (n,) of free runs, each from the row that `begins` it (n,) with that row's start speed (n,)."""
    out = np.empty(driven.step_s.size)
    _run(*driven, friction.top_rad_s, friction.forward, friction.backward, begins, start_rad_s, out)
    return out
