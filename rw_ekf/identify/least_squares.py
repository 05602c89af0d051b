"""Batch nonlinear least squares with a priori, by orthogonal transformation [CK13 (6)-(12)].

The loss is [CK13 (6)], J = |y - omega(p, omega_0)|^2 / R + |p - p_0|^2 in the metric of P_0^-1, where omega(.) is the
free run of the event-located model and omega_0 is free in every stretch of the log. Each stretch is triangularised by
Householder QR [CK13 (7)-(8)], which eliminates its initial speed; the rows left over are stacked with the a priori and
triangularised again, and [CK13 (10)] is solved by back substitution, damped after Marquardt. Break-away makes the loss
many-valleyed in T_s: several starts, the lowest loss wins. p are the four parameters, then the coefficients of effects.
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
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, PARAMETER_COUNT, SPEED, STATE_SIZE, FrictionParameters
from rw_ekf.wheel.table import ABSENT, NO_EFFECTS, EffectSet

_MAX_ITERATIONS = 60
_STEP_TOLERANCE = 1.0e-3  # in standard deviations of the estimate
_SPEED_STEP = 0.1  # of the speed noise, for a slope by differences of whole runs
_PARAMETER_STEP = 1.0e-3  # of a parameter
_LEAST_PARAMETER_STEP = 1.0e-6
OUTLIER_STDS = 6.0  # of what is left: readings beyond are no noise, ...
OUTLIER_SHARE = 0.01  # ... unless there are more of them than this share: then the model is wrong


@dataclass(frozen=True)
class LeastSquaresResult:
    """The estimate and how it was reached. Covariance (4 + m, 4 + m) is scaled by the residual's variance."""

    parameters: FrictionParameters
    coefficients: Float64Array  # (m,) of the effects
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
        """Standard deviations of the four parameters and the coefficients, (4 + m,)."""
        return np.sqrt(np.diag(self.covariance))


@dataclass(frozen=True)
class _Linearised:
    """One stretch after QR: omega_0 is given by the first row, the rest constrains the parameters alone."""

    head: float  # R[0, 0]
    head_parameters: Float64Array  # R[0, 1 : 1 + p]
    head_residual: float
    rows: Float64Array  # (p, p) upper triangular
    residual: Float64Array  # (p,)


@dataclass
class _Point:
    p: Float64Array  # (4 + m,)
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
        effects: EffectSet,
        used: BoolArray,
        advance: Callable[[], object],
    ) -> None:
        self.advance = advance
        self.course = course
        self.constants = constants
        self.effects = effects
        self.table = effects.table()
        self.used = used
        self.runs: list[Stretch] = stretches(course, constants.max_gap_s)
        self.first, self.last = np.array(self.runs, dtype=np.int64).reshape(-1, 2).T
        self.prior_mean, covariance = _known(prior, effects)
        self.size = self.prior_mean.size
        factor = np.linalg.cholesky(np.linalg.inv(covariance))
        self.prior_root = factor.T  # upper triangular, root' root = P_0^-1   [CK13 (7)]
        self.variance = constants.speed_variance + effects.reading_variance  # R
        self.weight = 1.0 / math.sqrt(self.variance)
        coefficients = [term.effect.coefficient for term in effects.state_terms for _ in term.values]
        self.lower = np.array([-math.inf] * PARAMETER_COUNT + [item.lower for item in coefficients])
        self.upper = np.array([math.inf] * PARAMETER_COUNT + [item.upper for item in coefficients])

    def run(self, p: Float64Array, omega_0: Float64Array, *, with_jacobian: bool = False) -> FreeRun:
        """Every stretch from its own first speed, hidden states settled there, under one set of parameters."""
        table, stribeck = self.table, self.constants.stribeck
        states = np.zeros((len(self.runs), table.size))
        states[:, SPEED] = omega_0
        states[:, MOTOR_GAIN : MOTOR_GAIN + self.size] = p
        if table.lag_state_at != ABSENT:
            before = np.maximum(self.course.piece_start[self.first] - 1, self.course.first_piece[self.first])
            current = self.course.pieces.current_A
            states[:, table.lag_state_at] = current[np.minimum(before, current.size - 1)]
        if table.memory_state_at != ABSENT:
            turning = np.abs(omega_0) > stribeck.omega_s
            states[:, table.memory_state_at] = np.where(turning, np.copysign(states[:, COULOMB], omega_0), 0.0)
        return free_run(
            self.course, self.effects, stribeck, states, self.first, self.last - 1,
            keep_path=True, with_jacobian=with_jacobian,
        )  # fmt: skip

    def sensitivity(self, at: _Point) -> Float64Array:
        """Slopes of the whole run by first speed and parameters, (n, 1 + p).

        Where the flow does not know them, central differences of whole runs: by the coefficient of a delay, a lag or a
        Stribeck shape, and by everything where friction has a memory.
        """
        x = np.concatenate(([0.0], at.p))  # the first place moves all first speeds at once
        if self.table.memory_at != ABSENT:
            jacobian, places = np.zeros((self.course.samples, x.size)), list(range(x.size))
        else:
            jacobian = self.run(at.p, at.omega_0, with_jacobian=True).jacobian[:, : x.size]
            flags = [term.effect.analytic for term in self.effects.state_terms for _ in term.values]
            places = [STATE_SIZE + i for i, analytic in enumerate(flags) if not analytic]
        lower, upper = np.append(-math.inf, self.lower), np.append(math.inf, self.upper)
        steps = self._step_sizes(at.p) if places else []
        for j in places:
            ends, reached = [], []
            for way in (1.0, -1.0):
                moved = x.copy()
                moved[j] = min(max(x[j] + way * steps[j], lower[j]), upper[j])
                ends.append(self.run(moved[1:], at.omega_0 + moved[0]).path_rad_s)
                reached.append(moved[j])
            jacobian[:, j] = (ends[0] - ends[1]) / (reached[0] - reached[1])
        return jacobian

    def _step_sizes(self, p: Float64Array) -> list[float]:
        """By how much first speed, parameters and coefficients are moved for a slope."""
        sizes = [_SPEED_STEP / self.weight]
        sizes += [max(_PARAMETER_STEP * abs(value), _LEAST_PARAMETER_STEP) for value in p[:PARAMETER_COUNT]]
        kinds = [(t.effect.coefficient, std) for t in self.effects.state_terms for std in t.stds]
        pairs = zip(kinds, p[PARAMETER_COUNT:], strict=True)
        return sizes + [kind.step_at(float(value)) or kind.step_share * std for (kind, std), value in pairs]

    def evaluate(self, p: Float64Array, omega_0: Float64Array) -> _Point:
        simulated = self.run(p, omega_0).path_rad_s
        with np.errstate(over="ignore", invalid="ignore"):  # a step too far: its loss counts as infinite
            r = (self.course.speed_rad_s - simulated)[self.used] * self.weight
            a = self.prior_root @ (self.prior_mean - p)
            loss = float(r @ r + a @ a)
        return _Point(p, omega_0, loss if math.isfinite(loss) else math.inf, simulated)

    def linearise(self, at: _Point) -> tuple[list[_Linearised], Float64Array, Float64Array]:
        """QR of every stretch, then the stacked triangular system: (stretches, R (p, p), z (p,))."""
        jacobian, m = self.sensitivity(at), self.size
        self.advance()
        parts = []
        stack = [np.column_stack((self.prior_root, self.prior_root @ (self.prior_mean - at.p)))]
        for run in self.runs:
            use = self.used[run.first : run.last]
            block = np.empty((int(use.sum()), m + 2))
            block[:, :-1] = jacobian[run.first : run.last][use]
            block[:, -1] = (self.course.speed_rad_s - at.simulated)[run.first : run.last][use]
            upper = _triangularise(block * self.weight)
            full = np.zeros((m + 2, m + 2))
            full[: upper.shape[0]] = upper
            rows = full[1:-1, 1:]
            parts.append(_Linearised(full[0, 0], full[0, 1:-1], full[0, -1], rows[:, :-1], rows[:, -1]))
            stack.append(rows)
        upper = _triangularise(np.vstack(stack))
        return parts, upper[:m, :m], upper[:m, m]

    def step(
        self, at: _Point, parts: list[_Linearised], R: Float64Array, z: Float64Array, damping: float
    ) -> tuple[Float64Array, _Point]:
        """Damped solution of [CK13 (10)] and the point it leads to."""
        scale = np.sqrt(damping) * np.sqrt((R * R).sum(axis=0))
        m = self.size
        damped = _triangularise(np.column_stack((np.vstack((R, np.diag(scale))), np.concatenate((z, np.zeros(m))))))
        dp = np.asarray(np.linalg.solve(damped[:m, :m], damped[:m, m]), dtype=np.float64)
        dp = np.clip(dp, self.lower - at.p, self.upper - at.p)
        omega_0 = at.omega_0.copy()
        for j, part in enumerate(parts):
            if abs(part.head) > 1.0e-9 * self.weight:
                omega_0[j] += (part.head_residual - part.head_parameters @ dp) / part.head
        return dp, self.evaluate(at.p + dp, omega_0)

    def solve(self, start: Float64Array) -> tuple[_Point, bool, int]:
        """Levenberg-Marquardt from `start` (4 + m,)."""
        omega_0 = np.array([float(self.course.speed_rad_s[run.first]) for run in self.runs])
        point = self.evaluate(np.clip(start, self.lower, self.upper), omega_0)
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
    effects: EffectSet = NO_EFFECTS,
    *,
    starts: list[FrictionParameters] | None = None,
    advance: Callable[[], object] = lambda: None,
) -> LeastSquaresResult:
    """Fit the four parameters to a log; without `starts`, from the filter's estimate and three values of T_s.

    With `effects` the prior is that of a model with them, and their coefficients in the state are fitted with the rest;
    the course must know temperature and angle where they read them. R is constants.speed_variance and what effects add
    to it; the covariance is scaled by the residual actually left. Readings further than six robust standard deviations
    from the fit are left out once, if they are fewer than 1 % (spikes, not misfit).
    `advance` is called at every iteration. Raises FilterError when the log has fewer than ten readings.
    """
    used = np.isfinite(course.speed_rad_s)
    if int(used.sum()) < 10:
        raise FilterError(f"{int(used.sum())} speed readings are too few to fit four parameters; ten are the least.")
    if starts is None:
        points = default_starts(course, constants, prior, effects)
    else:
        points = [np.concatenate((start, _known(prior, effects)[0][PARAMETER_COUNT:])) for start in starts]
    problem = _Problem(course, constants, prior, effects, _inside_stretches(course, constants, used), advance)
    best, converged, iterations = _best_of(problem, points)
    outliers = _outliers(problem, best)
    if outliers.size:
        keep = problem.used.copy()
        keep[outliers] = False
        problem = _Problem(course, constants, prior, effects, keep, advance)
        # Spikes may have drawn the first fit into another valley, so that the starts are tried again.
        best, converged, iterations = _best_of(problem, [*points, best.p])
    _, R, _ = problem.linearise(best)
    residual = (course.speed_rad_s - best.simulated)[problem.used]
    freedom = max(residual.size - problem.size - len(problem.runs), 1)
    variance = float(residual @ residual) / freedom
    covariance = _covariance(problem.prior_root, R, variance / problem.variance)
    return LeastSquaresResult(
        parameters=FrictionParameters(*(float(v) for v in best.p[:PARAMETER_COUNT])),
        coefficients=best.p[PARAMETER_COUNT:],
        covariance=covariance,
        initial_speeds_rad_s=best.omega_0,
        residual_rms_rad_s=math.sqrt(float(np.mean(residual**2))),
        loss=best.loss,
        converged=converged,
        iterations=iterations,
        starts=len(points),
        samples=int(problem.used.sum()),
        outliers=int(outliers.size),
        simulated_rad_s=best.simulated,
    )


def default_starts(
    course: Course, constants: FilterConstants, prior: Belief, effects: EffectSet = NO_EFFECTS
) -> list[Float64Array]:
    """The filter's own estimate, and two others that differ in T_s: equal to c, and a third above it; (4 + m,) each."""
    run = filter_log(course, constants, prior.mean, prior.covariance, effects)
    known, _ = _known(Belief(run.mean, run.covariance), effects)
    here, rest = FrictionParameters(*(float(v) for v in known[:PARAMETER_COUNT])), known[PARAMETER_COUNT:]
    statics = (here.static, here.coulomb, 1.35 * here.coulomb)
    return [np.concatenate((here._replace(static=static), rest)) for static in statics]


def _known(belief: Belief, effects: EffectSet) -> tuple[Float64Array, Float64Array]:
    """Mean (4 + m,) and covariance (4 + m, 4 + m) of parameters and coefficients, without speed and hidden states."""
    here = slice(MOTOR_GAIN, STATE_SIZE + effects.size)
    return belief.mean[here].copy(), belief.covariance[here, here]


def _best_of(problem: _Problem, starts: list[Float64Array]) -> tuple[_Point, bool, int]:
    return min((problem.solve(start) for start in starts), key=lambda item: item[0].loss)


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
    data = seen.T @ seen - np.eye(R.shape[0])
    values, vectors = np.linalg.eigh(0.5 * (data + data.T))
    spread = 1.0 / (1.0 + np.maximum(values, 0.0) / max(variance_factor, 1.0e-12))
    root = to_natural @ vectors * np.sqrt(spread)
    return np.asarray(root @ root.T, dtype=np.float64)
