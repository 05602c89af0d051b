"""The "deterministic" method: each parameter from the stretch of a log that shows it alone [CK13, section 4].

Coast-downs (no current, well above the Stribeck speed) give b and c: d omega/dt = -b omega - c. Constant-current runs
at speed then give k: d omega/dt + b omega + sgn c = k I. The current at which a resting wheel starts gives T_s within a
bracket. Everything is a linear regression over windows of the integrated equation, so that no speed is differentiated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.course.course import Course
from rw_ekf.errors import FilterError
from rw_ekf.filter.belief import Belief
from rw_ekf.model.friction import FAST_STRIBECK_SPEEDS
from rw_ekf.model.state import FrictionParameters

_COAST_SECONDS = 5.0
_REST_STDS = 4.0


@dataclass(frozen=True)
class DeterministicResult:
    """Estimates with standard deviations, and what they rest on."""

    parameters: FrictionParameters
    std: tuple[float, float, float, float]
    coast_down_s: float
    driven_s: float
    break_aways: int


@dataclass(eq=False, frozen=True)
class _Regression:
    solution: Float64Array
    covariance: Float64Array


def deterministic(
    course: Course, current_A: Float64Array, omega_s: float, speed_noise_rad_s: float, prior: Belief
) -> DeterministicResult:
    """Estimate from dedicated stretches; current_A (n,) is in force from each sample on.

    What no stretch shows keeps the prior: k where nothing drives the wheel, T_s where it never starts from rest.
    Raises FilterError where there is no coast-down of five seconds: then the method has nothing to stand on.
    """
    speed = course.speed_rad_s
    fast = np.abs(speed) > FAST_STRIBECK_SPEEDS * omega_s
    largest = float(np.max(np.abs(current_A))) if current_A.size else 0.0
    coasting = fast & (np.abs(current_A) <= 1.0e-3 * largest)
    coast = _stretches(course, coasting, _COAST_SECONDS)
    if not coast:
        raise FilterError(
            "the deterministic method needs a coast-down: five seconds or more without current, well above the "
            f"Stribeck speed ({omega_s:.3g} rad/s). `rw-ekf excite identification` has some; "
            "`--method least-squares` needs none."
        )
    decay = _regress(course, current_A, coast, speed_noise_rad_s, unknown=(1, 2), known=np.zeros(3))
    b, c = (float(v) for v in decay.solution)
    driven = _stretches(course, fast & ~coasting, 1.0)
    k, k_std = prior.parameters.motor_gain, prior.parameter_std.motor_gain
    if driven:
        drive = _regress(course, current_A, driven, speed_noise_rad_s, unknown=(0,), known=np.array([0.0, b, c]))
        k = float(drive.solution[0])
        # What b and c may be wrong by moves k: the mean drag over the driven stretch against the mean current.
        k_std = math.hypot(math.sqrt(float(drive.covariance[0, 0])), math.sqrt(float(decay.covariance[1, 1])) / largest)
    starts = _break_away(course, current_A, speed_noise_rad_s, k, c) if driven else None
    static, static_std, count = starts or (prior.parameters.static, prior.parameter_std.static, 0)
    return DeterministicResult(
        FrictionParameters(k, b, c, static),
        (k_std, math.sqrt(float(decay.covariance[0, 0])), math.sqrt(float(decay.covariance[1, 1])), static_std),
        _seconds(course, coast),
        _seconds(course, driven),
        count,
    )


def _stretches(course: Course, wanted: BoolArray, least_s: float) -> list[tuple[int, int]]:
    """Runs of samples first..last (inclusive) with `wanted`, one direction of rotation, one segment, long enough."""
    sign = np.sign(np.nan_to_num(course.speed_rad_s))
    key = np.where(wanted, sign, 0.0)
    cut = np.flatnonzero((np.diff(key) != 0.0) | (np.diff(course.segment) != 0)) + 1
    edges = [0, *(int(i) for i in cut), key.size]
    return [
        (a, b - 1)
        for a, b in pairwise(edges)
        if key[a] != 0.0 and b - a > 3 and course.time_s[b - 1] - course.time_s[a] >= least_s
    ]


def _seconds(course: Course, runs: list[tuple[int, int]]) -> float:
    return float(sum(course.time_s[b] - course.time_s[a] for a, b in runs))


def _regress(
    course: Course,
    current_A: Float64Array,
    runs: list[tuple[int, int]],
    speed_noise: float,
    *,
    unknown: tuple[int, ...],
    known: Float64Array,
) -> _Regression:
    """Fit speed(t) - speed(0) = k Q - b X - c S within each run; Q, X, S integrals of current, speed, direction.

    The speed at the run's start is a parameter of its own, so that residuals are independent readings.
    """
    blocks, targets = [], []
    for j, (first, last) in enumerate(runs):
        t = course.time_s[first : last + 1]
        y = course.speed_rad_s[first : last + 1]
        dt = np.diff(t)
        charge = np.concatenate(([0.0], np.cumsum(current_A[first:last] * dt)))
        turned = np.concatenate(([0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * dt)))
        direction = math.copysign(1.0, float(y[0])) * (t - t[0])
        full = np.column_stack((charge, -turned, -direction))
        start = np.zeros((t.size, len(runs)))
        start[:, j] = 1.0
        blocks.append(np.column_stack((full[:, list(unknown)], start)))
        targets.append(y - full @ known)
    A, z = np.vstack(blocks), np.concatenate(targets)
    solution, *_ = np.linalg.lstsq(A, z, rcond=None)
    residual = z - A @ solution
    variance = max(float(residual @ residual) / max(z.size - A.shape[1], 1), speed_noise**2)
    n = len(unknown)
    return _Regression(solution[:n], (variance * np.linalg.pinv(A.T @ A))[:n, :n])


def _break_away(
    course: Course, current_A: Float64Array, speed_noise: float, k: float, c: float
) -> tuple[float, float, int] | None:
    """T_s from starts from rest: between the largest drive that did not move the wheel and the one that did."""
    resting = np.abs(np.nan_to_num(course.speed_rad_s, nan=np.inf)) < _REST_STDS * speed_noise
    brackets = []
    i = 0
    n = resting.size
    while i < n:
        if not resting[i]:
            i += 1
            continue
        first = i
        while i < n and resting[i]:
            i += 1
        if i < n and course.time_s[i - 1] - course.time_s[first] >= 1.0:
            held = np.abs(current_A[first : max(first + 1, i - 5)])
            brackets.append((k * float(held.max()), k * float(np.abs(current_A[first:i]).max())))
    usable = [(low, high) for low, high in brackets if high > 0.0]
    if not usable:
        return None
    middles = np.array([0.5 * (low + high) for low, high in usable])
    widths = np.array([high - low for low, high in usable])
    std = max(float(np.mean(widths)) / math.sqrt(12.0), float(np.std(middles))) / math.sqrt(len(usable))
    return float(np.median(middles)), max(std, 0.02 * abs(c)), len(usable)
