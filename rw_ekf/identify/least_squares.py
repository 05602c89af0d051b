"""Batch nonlinear least squares with a priori [CK13 (6)-(12)]: the free run's loss at its lowest.

Break-away makes the loss many-valleyed in T_s: several starts, the lowest loss wins.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.errors import FilterError
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.identify.free_run_loss import FreeRunLoss, Point
from rw_ekf.identify.orthogonal import linearised, posterior_covariance
from rw_ekf.model.state import PARAMETER_COUNT, FrictionParameters
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet

_GROWS = 1.0  # logarithm of what an error grows by over a record: with a viscous friction that is one it shrinks
_MAX_ITERATIONS = 60
_STEP_TOLERANCE = 1.0e-3  # in standard deviations of the estimate
OUTLIER_STDS = 6.0  # of what is left: readings beyond are no noise, ...
OUTLIER_SHARE = 0.01  # ... unless there are more of them than this share: then the model is wrong


@dataclass(eq=False, frozen=True)
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
        coefficients = prior.known(effects.size)[0][PARAMETER_COUNT:]
        points = [np.concatenate((start, coefficients)) for start in starts]
    loss = FreeRunLoss(course, constants, prior, effects, used)
    best, converged, iterations = _best_of(loss, points, advance)
    outliers = _outliers(loss, best)
    if outliers.size:
        used[outliers] = False
        loss = FreeRunLoss(course, constants, prior, effects, used)
        # Spikes may have drawn the first fit into another valley, so that the starts are tried again.
        best, converged, iterations = _best_of(loss, [*points, best.p], advance)
    advance()
    residual = (course.speed_rad_s - best.simulated)[loss.used]
    freedom = max(residual.size - loss.size - len(loss.runs), 1)
    variance = float(residual @ residual) / freedom
    return LeastSquaresResult(
        parameters=FrictionParameters(*(float(v) for v in best.p[:PARAMETER_COUNT])),
        coefficients=best.p[PARAMETER_COUNT:],
        covariance=posterior_covariance(loss.prior_root, linearised(loss, best).root, variance / loss.variance),
        initial_speeds_rad_s=best.omega_0,
        residual_rms_rad_s=math.sqrt(float(np.mean(residual**2))),
        loss=best.loss,
        converged=converged,
        iterations=iterations,
        starts=len(points),
        samples=int(loss.used.sum()),
        outliers=int(outliers.size),
        simulated_rad_s=best.simulated,
    )


def default_starts(course: Course, constants: FilterConstants, prior: Belief, effects: EffectSet) -> list[Float64Array]:
    """The filter's own estimate, and two others that differ in T_s: equal to c, and a third above it; (4 + m,) each.

    The a priori in place of an estimate with which a free run would run away: where the filter lost its way.
    """
    run = filter_log(course, constants, prior.mean, prior.covariance, effects)
    here = Belief(run.mean, run.covariance)
    if -here.parameters.viscous * float(np.ptp(course.time_s)) > _GROWS:
        here = prior
    found, coefficients = here.parameters, here.known(effects.size)[0][PARAMETER_COUNT:]
    statics = (found.static, found.coulomb, 1.35 * found.coulomb)
    return [np.concatenate((found._replace(static=static), coefficients)) for static in statics]


def _best_of(loss: FreeRunLoss, starts: list[Float64Array], advance: Callable[[], object]) -> tuple[Point, bool, int]:
    return min((_lowest_from(loss, start, advance) for start in starts), key=lambda item: item[0].loss)


def _lowest_from(loss: FreeRunLoss, start: Float64Array, advance: Callable[[], object]) -> tuple[Point, bool, int]:
    """Levenberg-Marquardt from `start` (4 + m,): where it ends, whether it converged, iterations."""
    point = loss.at(start)
    damping = 1.0e-3
    for iteration in range(1, _MAX_ITERATIONS + 1):
        triangle = linearised(loss, point)
        advance()
        sigma = np.sqrt(np.diag(posterior_covariance(loss.prior_root, triangle.root)))
        while True:
            dp = np.clip(triangle.damped_step(damping), loss.lower - point.p, loss.upper - point.p)
            steps = [stretch.first_speed_step(dp, 1.0e-9 * loss.weight) for stretch in triangle.stretches]
            trial = loss.at(point.p + dp, point.omega_0 + np.array(steps))
            # Where the model is wrong the loss is many times the readings' number; "small" is judged against that.
            factor = max(1.0, point.loss / max(int(loss.used.sum()), 1))
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


def _outliers(loss: FreeRunLoss, at: Point) -> NDArray[np.intp]:
    residual = np.where(loss.used, loss.course.speed_rad_s - at.simulated, np.nan)
    middle = np.nanmedian(residual)
    spread = 1.4826 * float(np.nanmedian(np.abs(residual - middle)))
    found = np.flatnonzero(np.abs(residual - middle) > OUTLIER_STDS * max(spread, 1.0 / loss.weight))
    return found if found.size <= OUTLIER_SHARE * loss.used.sum() else found[:0]
