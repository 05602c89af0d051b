"""Free-run simulation of a log with the estimator's own model, and its sensitivity: what least squares is built on."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course import course as _course
from rw_ekf.course.course import Course
from rw_ekf.model.friction import FrictionCurve, Stribeck
from rw_ekf.model.state import FrictionParameters
from rw_ekf.wheel.compiled import compile_cached
from rw_ekf.wheel.equations import EQUATIONS
from rw_ekf.wheel.transition import interval


def _simulate_stretch(
    omega: float,
    k: float,
    curve: FrictionCurve,
    course: Course,
    first: int,
    last: int,
    speeds: Float64Array,
    jacobian: Float64Array,
) -> None:
    """Simulate samples first..last from `omega`; jacobian (n, 5) gets d speed / d (omega_first, k, b, c, s)."""
    pieces, piece_start = course.pieces, course.piece_start
    with_jacobian = jacobian.shape[0] > 0
    g0, g1, g2, g3, g4 = 1.0, 0.0, 0.0, 0.0, 0.0
    for i in range(first, last):
        if i > first:
            omega, f0, f1, f2, f3, f4 = interval(omega, k, curve, pieces, piece_start[i - 1], piece_start[i])
            g0 = f0 * g0
            g1 = f0 * g1 + f1
            g2 = f0 * g2 + f2
            g3 = f0 * g3 + f3
            g4 = f0 * g4 + f4
        speeds[i] = omega
        if with_jacobian:
            jacobian[i, 0] = g0
            jacobian[i, 1] = g1
            jacobian[i, 2] = g2
            jacobian[i, 3] = g3
            jacobian[i, 4] = g4


def _example() -> tuple[Any, ...]:
    series = np.zeros(0)
    course = Course.of(series, series, series)
    return 1.0, 1.0, FrictionCurve(1.0, 1.0, 1.0, 1.0, 0), course, 0, 0, series, np.zeros((0, 5))


simulate_stretch = compile_cached(_simulate_stretch, [*EQUATIONS, _course, sys.modules[__name__]], _example)


@dataclass(frozen=True)
class Stretch:
    """Samples first <= i < last that one free run covers, from its own initial speed."""

    first: int
    last: int


def stretches(course: Course, max_gap_s: float) -> list[Stretch]:
    """Cut a log where a segment changes or time leaps by more than max_gap_s, dropping leading missing speeds."""
    n = course.time_s.size
    if n == 0:
        return []
    cut = np.flatnonzero((np.diff(course.segment) != 0) | (np.diff(course.time_s) > max_gap_s)) + 1
    edges = [0, *(int(i) for i in cut), n]
    found = []
    for a, b in pairwise(edges):
        present = np.flatnonzero(np.isfinite(course.speed_rad_s[a:b]))
        if present.size:
            found.append(Stretch(a + int(present[0]), b))
    return found


def simulate(
    course: Course,
    runs: list[Stretch],
    initial_speeds_rad_s: Float64Array,
    parameters: FrictionParameters,
    stribeck: Stribeck,
    *,
    with_jacobian: bool = False,
) -> tuple[Float64Array, Float64Array]:
    """Free-run speeds (n,), NaN outside the stretches, and the jacobian (n, 5) or (0, 5)."""
    n = course.time_s.size
    speeds = np.full(n, np.nan)
    jacobian = np.zeros((n if with_jacobian else 0, 5))
    curve = FrictionCurve(*parameters[1:], *stribeck)
    for run, omega in zip(runs, initial_speeds_rad_s, strict=True):
        simulate_stretch(float(omega), parameters.motor_gain, curve, course, run.first, run.last, speeds, jacobian)
    return speeds, jacobian
