"""Batch nonlinear least squares with a priori, by orthogonal transformation [CK13 (6)-(12)].

The loss is [CK13 (6)], J = |y - omega(p, omega_0)|^2 / R + |p - p_0|^2 in the metric of P_0^-1, where omega(.) is the
free run of the event-located model and omega_0 is free in every stretch of the log. Each stretch is triangularised by
Householder QR [CK13 (7)-(8)], which eliminates its initial speed; the rows left over are stacked with the a priori and
triangularised again, and [CK13 (10)] is solved by back substitution, damped after Marquardt. Break-away makes the loss
many-valleyed in T_s: several starts, the lowest loss wins.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.course.course import Course
from rw_ekf.course.free_run import FreeRun, Stretch, free_run, stretches
from rw_ekf.errors import FilterError
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.model.state import FrictionParameters
from rw_ekf.wheel.table import NO_EFFECTS

_MAX_ITERATIONS = 60
_STEP_TOLERANCE = 1.0e-3  # in standard deviations of the estimate
OUTLIER_STDS = 6.0  # of what is left: readings beyond are no noise, ...
OUTLIER_SHARE = 0.01  # ... unless there are more of them than this share: then the model is wrong


@dataclass(frozen=True)
class LeastSquaresResult:
    """The estimate and how it was reached. Covariance (4, 4) is scaled by the residual's variance."""

    parameters: FrictionParameters
    covariance: Float64Array
    initial_speeds_rad_s: Float64Array  # one per stretch
    residual_rms_rad_s: float
    loss: float
    converged: bool
    iterations: int
    starts: int
    samples: int
    outliers: int
    simulated_rad_s: Float64Array  # (n,) free run, NaN outside the stretches

    @property
    def std(self) -> Float64Array:
        """Standard deviations of the four parameters."""
        return np.sqrt(np.diag(self.covariance))


@dataclass(frozen=True)
class _Linearised:
    """One stretch after QR: omega_0 is given by the first row, the rest constrains the parameters alone."""

    head: float  # R[0, 0]
    head_parameters: Float64Array  # R[0, 1:5]
    head_residual: float
    rows: Float64Array  # (4, 4) upper triangular
    residual: Float64Array  # (4,)


@dataclass
class _Point:
    p: Float64Array  # (4,)
    omega_0: Float64Array  # (stretches,)
    loss: float
    simulated: Float64Array


def _triangularise(matrix: Float64Array) -> Float64Array:
    """Upper triangle after Householder's transformation [CK13 (8)], (min(rows, columns), columns)."""
    return np.asarray(np.linalg.qr(matrix, mode="r"), dtype=np.float64)


class _Problem:
    """The loss, its linearisation and the damped step, for one log."""

    def __init__(
        self,
        course: Course,
        constants: FilterConstants,
        prior: Belief,
        used: BoolArray,
        advance: Callable[[], object],
    ) -> None:
        self.advance = advance
        self.course = course
        self.constants = constants
        self.used = used
        self.runs: list[Stretch] = stretches(course, constants.max_gap_s)
        self.prior_mean = np.array(prior.parameters)
        factor = np.linalg.cholesky(np.linalg.inv(prior.parameter_covariance))
        self.prior_root = factor.T  # upper triangular, root' root = P_0^-1   [CK13 (7)]
        self.weight = 1.0 / math.sqrt(constants.speed_variance)

    def run(self, p: Float64Array, omega_0: Float64Array, *, with_jacobian: bool = False) -> FreeRun:
        """Every stretch from its own first speed, under one set of parameters."""
        first, last = np.array(self.runs, dtype=np.int64).reshape(-1, 2).T
        states = np.column_stack((omega_0, np.tile(p, (len(self.runs), 1))))
        return free_run(
            self.course, NO_EFFECTS, self.constants.stribeck, states, first, last - 1,
            keep_path=True, with_jacobian=with_jacobian,
        )  # fmt: skip

    def evaluate(self, p: Float64Array, omega_0: Float64Array) -> _Point:
        simulated = self.run(p, omega_0).path_rad_s
        with np.errstate(over="ignore", invalid="ignore"):  # a step too far: its loss counts as infinite
            r = (self.course.speed_rad_s - simulated)[self.used] * self.weight
            a = self.prior_root @ (self.prior_mean - p)
            loss = float(r @ r + a @ a)
        return _Point(p, omega_0, loss if math.isfinite(loss) else math.inf, simulated)

    def linearise(self, at: _Point) -> tuple[list[_Linearised], Float64Array, Float64Array]:
        """QR of every stretch, then the stacked triangular system: (stretches, R (4, 4), z (4,))."""
        _, simulated, jacobian = self.run(at.p, at.omega_0, with_jacobian=True)
        self.advance()
        parts = []
        stack = [np.column_stack((self.prior_root, self.prior_root @ (self.prior_mean - at.p)))]
        for run in self.runs:
            use = self.used[run.first : run.last]
            block = np.empty((int(use.sum()), 6))
            block[:, :5] = jacobian[run.first : run.last][use]
            block[:, 5] = (self.course.speed_rad_s - simulated)[run.first : run.last][use]
            upper = _triangularise(block * self.weight)
            full = np.zeros((6, 6))
            full[: upper.shape[0]] = upper
            parts.append(_Linearised(full[0, 0], full[0, 1:5], full[0, 5], full[1:5, 1:5], full[1:5, 5]))
            stack.append(full[1:5, 1:6])
        upper = _triangularise(np.vstack(stack))
        return parts, upper[:4, :4], upper[:4, 4]

    def step(
        self, at: _Point, parts: list[_Linearised], R: Float64Array, z: Float64Array, damping: float
    ) -> tuple[Float64Array, _Point]:
        """Damped solution of [CK13 (10)] and the point it leads to."""
        scale = np.sqrt(damping) * np.sqrt((R * R).sum(axis=0))
        damped = _triangularise(np.column_stack((np.vstack((R, np.diag(scale))), np.concatenate((z, np.zeros(4))))))
        dp = np.asarray(np.linalg.solve(damped[:4, :4], damped[:4, 4]), dtype=np.float64)
        omega_0 = at.omega_0.copy()
        for j, part in enumerate(parts):
            if abs(part.head) > 1.0e-9 * self.weight:
                omega_0[j] += (part.head_residual - part.head_parameters @ dp) / part.head
        return dp, self.evaluate(at.p + dp, omega_0)

    def solve(self, start: Float64Array) -> tuple[_Point, bool, int]:
        """Levenberg-Marquardt from `start` (4,)."""
        omega_0 = np.array([float(self.course.speed_rad_s[run.first]) for run in self.runs])
        point = self.evaluate(start, omega_0)
        damping = 1.0e-3
        for iteration in range(1, _MAX_ITERATIONS + 1):
            parts, R, z = self.linearise(point)
            sigma = np.sqrt(np.diag(_covariance(self.prior_root, R)))
            while True:
                dp, trial = self.step(point, parts, R, z, damping)
                # Where the model is wrong the loss is many times the readings' number; "small" is judged against that.
                factor = max(1.0, point.loss / max(int(self.used.sum()), 1))
                small = bool(np.all(np.abs(dp) < _STEP_TOLERANCE * math.sqrt(factor) * sigma))
                if trial.loss <= point.loss:
                    break
                if small or damping > 1.0e12:
                    return point, small, iteration
                damping *= 8.0
            gained = point.loss - trial.loss
            point = trial
            damping = max(damping / 8.0, 1.0e-9)
            if small and gained < 1.0e-3 * factor:
                return point, True, iteration
        return point, False, _MAX_ITERATIONS


def least_squares(
    course: Course,
    constants: FilterConstants,
    prior: Belief,
    *,
    starts: list[FrictionParameters] | None = None,
    advance: Callable[[], object] = lambda: None,
) -> LeastSquaresResult:
    """Fit the four parameters to a log; without `starts`, from the filter's estimate and three values of T_s.

    R is constants.speed_variance; the covariance is scaled by the residual actually left. Readings further than six
    robust standard deviations from the fit are left out once, if they are fewer than 1 % (spikes, not misfit).
    `advance` is called at every iteration. Raises FilterError when the log has fewer than ten readings.
    """
    used = np.isfinite(course.speed_rad_s)
    if int(used.sum()) < 10:
        raise FilterError(f"{int(used.sum())} speed readings are too few to fit four parameters; ten are the least.")
    if starts is None:
        starts = default_starts(course, constants, prior)
    problem = _Problem(course, constants, prior, _inside_stretches(course, constants, used), advance)
    best, converged, iterations = _best_of(problem, starts)
    outliers = _outliers(problem, best)
    if outliers.size:
        keep = problem.used.copy()
        keep[outliers] = False
        problem = _Problem(course, constants, prior, keep, advance)
        # Spikes may have drawn the first fit into another valley, so that the starts are tried again.
        best, converged, iterations = _best_of(problem, [*starts, FrictionParameters(*best.p)])
    _, R, _ = problem.linearise(best)
    residual = (course.speed_rad_s - best.simulated)[problem.used]
    freedom = max(residual.size - 4 - len(problem.runs), 1)
    variance = float(residual @ residual) / freedom
    covariance = _covariance(problem.prior_root, R, variance / constants.speed_variance)
    return LeastSquaresResult(
        parameters=FrictionParameters(*(float(v) for v in best.p)),
        covariance=covariance,
        initial_speeds_rad_s=best.omega_0,
        residual_rms_rad_s=math.sqrt(float(np.mean(residual**2))),
        loss=best.loss,
        converged=converged,
        iterations=iterations,
        starts=len(starts),
        samples=int(problem.used.sum()),
        outliers=int(outliers.size),
        simulated_rad_s=best.simulated,
    )


def default_starts(course: Course, constants: FilterConstants, prior: Belief) -> list[FrictionParameters]:
    """The filter's own estimate, and two others that differ in T_s: equal to c, and a third above it."""
    run = filter_log(course, constants, prior.mean, prior.covariance)
    found = Belief(run.mean, run.covariance).parameters
    return [found._replace(static=static) for static in (found.static, found.coulomb, 1.35 * found.coulomb)]


def _best_of(problem: _Problem, starts: list[FrictionParameters]) -> tuple[_Point, bool, int]:
    solved = [problem.solve(np.array(start, dtype=np.float64)) for start in starts]
    return min(solved, key=lambda item: item[0].loss)


def _inside_stretches(course: Course, constants: FilterConstants, used: BoolArray) -> BoolArray:
    inside = np.zeros(used.size, dtype=bool)
    for run in stretches(course, constants.max_gap_s):
        inside[run.first : run.last] = True
    return used & inside


def _outliers(problem: _Problem, at: _Point) -> NDArray[np.intp]:
    residual = np.where(problem.used, problem.course.speed_rad_s - at.simulated, np.nan)
    middle = np.nanmedian(residual)
    spread = 1.4826 * float(np.nanmedian(np.abs(residual - middle)))
    found = np.flatnonzero(np.abs(residual - middle) > OUTLIER_STDS * max(spread, 1.0 / problem.weight))
    return found if found.size <= OUTLIER_SHARE * problem.used.sum() else found[:0]


def _covariance(prior_root: Float64Array, R: Float64Array, variance_factor: float = 1.0) -> Float64Array:
    """(R'R)^-1 with the data's share scaled by the variance factor; the a priori's share is not data.

    Reckoned in units of the a priori, where its share is the identity: whatever the data lack, the result is a
    covariance, and none wider than the a priori.
    """
    to_natural = np.linalg.inv(prior_root)
    seen = R @ to_natural
    data = seen.T @ seen - np.eye(4)
    values, vectors = np.linalg.eigh(0.5 * (data + data.T))
    spread = 1.0 / (1.0 + np.maximum(values, 0.0) / max(variance_factor, 1.0e-12))
    root = to_natural @ vectors * np.sqrt(spread)
    return np.asarray(root @ root.T, dtype=np.float64)
