"""Gain, friction and command delay from the readings of a move: linear least squares along stretches of motion.

Integrated once, with the current known as steps in time, the speed of a wheel that turns one way is (docs/model.md
eq. 1)

    omega(t) = omega_0 + k Q(t) - sgn(omega) c (t - t_0) - b int omega dt,   Q = int I dt,                           (1)

linear in k, c, b and an omega_0 for each stretch. Readings are independent, so their own noise is the residual.
Stretches in which the wheel stands, or might, are left out. A delay of the command beyond what the line takes shifts
Q in time: the one with the least residual is taken, its standard deviation from the curvature there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, by_identity
from rw_ekf.commissioning.guarded_wheel import Row

_LEAST_READINGS = 4  # of a stretch
_LONGEST_GAP_S = 1.0
_VISCOUS_1_S, _VISCOUS_STD_1_S = 0.003, 0.02  # what wheels have [CK13]; short moves do not show it
_DELAYS_S = (-0.05, 0.6)
_DELAY_STEP_S = 0.01


class MotionFit(NamedTuple):
    """What a move shows, per unit inertia; standard deviations beside."""

    gain: float  # rad/s^2/A
    gain_std: float
    coulomb: float  # rad/s^2
    coulomb_std: float
    residual_rad_s: float  # root mean square
    readings: int

    @property
    def sigmas(self) -> float:
        """By how many standard deviations the gain is away from zero."""
        return abs(self.gain) / self.gain_std if self.gain_std > 0.0 else math.inf


class DelayFit(NamedTuple):
    """A delay of the command beyond what the line takes."""

    delay_s: float
    std_s: float


def fit_motion(rows: Sequence[Row], rest_rad_s: float, delay_s: float = 0.0) -> MotionFit | None:
    """Fit (1); rest_rad_s: below it the wheel may stand. None where too little moved."""
    stretches = list(_stretches(rows, rest_rad_s))
    known = _Charge.of(rows, delay_s)
    if not stretches or known is None:
        return None
    solved = _solve(stretches, known)
    if solved is None:
        return None
    values, covariance, square_sum, readings, free = solved
    if free < 3:
        return None
    variance = square_sum / free
    stds = np.sqrt(variance * np.diag(covariance))
    return MotionFit(
        float(values[0]), float(stds[0]), float(values[1]), float(stds[1]), math.sqrt(square_sum / readings), readings
    )


def fit_late_motion(rows: Sequence[Row], rest_rad_s: float) -> tuple[MotionFit | None, DelayFit | None]:
    """Both: the motion under the delay that it shows."""
    delay = fit_delay(rows, rest_rad_s)
    return fit_motion(rows, rest_rad_s, 0.0 if delay is None else delay.delay_s), delay


def fit_delay(rows: Sequence[Row], rest_rad_s: float) -> DelayFit | None:
    """The delay with the least residual, by a parabola through three steps around it; None where too little moved."""
    stretches = list(_stretches(rows, rest_rad_s))
    delays = np.arange(_DELAYS_S[0], _DELAYS_S[1] + 0.5 * _DELAY_STEP_S, _DELAY_STEP_S)
    sums, free = [], 0
    for delay_s in delays:
        known = _Charge.of(rows, float(delay_s))
        solved = None if known is None or not stretches else _solve(stretches, known)
        if solved is None:
            return None
        sums.append(solved[2])
        free = solved[4]
    best = int(np.argmin(sums))
    if free < 6 or best in (0, len(sums) - 1):
        return None
    left, least, right = sums[best - 1 : best + 2]
    curvature = left - 2.0 * least + right
    if curvature <= 0.0:
        return None
    offset = 0.5 * (left - right) / curvature
    # S(d) = S0 + (curvature / 2) ((d - d0) / step)^2, and S grows by the variance of a reading at one sigma
    std_s = _DELAY_STEP_S * math.sqrt(2.0 * (least / free) / curvature)
    return DelayFit(float(delays[best]) + offset * _DELAY_STEP_S, std_s)


@by_identity
class _Charge(NamedTuple):
    """The integral of the current as a function of time: straight between the times at which it changed."""

    knots_s: Float64Array
    values_A_s: Float64Array

    @classmethod
    def of(cls, rows: Sequence[Row], delay_s: float) -> _Charge | None:
        reported = [row for row in rows if math.isfinite(row.command_A)]
        if len(reported) < 2:
            return None
        changes = np.maximum.accumulate([row.time_s + row.delay_s + delay_s for row in reported])
        currents = np.array([row.command_A for row in reported])
        knots = np.append(changes, changes[-1] + 1.0e3)
        return cls(knots, np.concatenate(([0.0], np.cumsum(currents * np.diff(knots)))))

    def at(self, times_s: Float64Array) -> Float64Array:
        return np.interp(times_s, self.knots_s, self.values_A_s)


def _stretches(rows: Sequence[Row], rest_rad_s: float) -> Iterable[Float64Array]:
    """Times and speeds (n, 2) of readings one after another in which the wheel turns one way."""
    run: list[tuple[float, float]] = []
    last: Row | None = None
    for row in rows:
        speed = row.speed_rad_s
        moves = speed is not None and abs(speed) > rest_rad_s and row.known
        apart = last is not None and (row.segment != last.segment or row.time_s - last.time_s > _LONGEST_GAP_S)
        if run and (not moves or apart or (speed is not None and speed * run[-1][1] < 0.0)):
            if len(run) >= _LEAST_READINGS:
                yield np.array(run)
            run = []
        if moves and speed is not None:
            run.append((row.time_s, speed))
        last = row
    if len(run) >= _LEAST_READINGS:
        yield np.array(run)


def _solve(
    stretches: Sequence[Float64Array], charge: _Charge
) -> tuple[Float64Array, Float64Array, float, int, int] | None:
    """(k, c, b), its covariance for a variance of one, the sum of squares, readings, degrees of freedom."""
    columns, readings = [], []
    for stretch in stretches:
        times, speeds = stretch[:, 0], stretch[:, 1]
        turned = np.concatenate(([0.0], np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * np.diff(times))))
        block = np.column_stack((charge.at(times), -math.copysign(1.0, speeds[0]) * (times - times[0]), -turned))
        columns.append(block - block.mean(axis=0))
        readings.append(speeds - speeds.mean())
    H, y = np.vstack(columns), np.concatenate(readings)
    free = y.size - len(stretches) - 3
    if free < 1:
        return None
    scale = max(float(np.sqrt(np.mean(np.square(y)))), 1.0e-12)
    weight = 0.05 * scale / _VISCOUS_STD_1_S  # of what is believed of b: it hardly matters, and keeps (1) solvable
    H = np.vstack((H, [0.0, 0.0, weight]))
    y = np.append(y, weight * _VISCOUS_1_S)
    normal = H.T @ H
    if np.linalg.cond(normal) > 1.0e14:
        return None
    covariance = np.linalg.inv(normal)
    values = covariance @ (H.T @ y)
    square_sum = float(np.sum(np.square(y - H @ values)[:-1]))
    return values, covariance, square_sum, y.size - 1, free
