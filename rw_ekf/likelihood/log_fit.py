"""A whole log fitted by generalised least squares: torque noise and reading noise both in the weights.

The free run of [CK13 (6)] takes every error for reading noise. A real wheel's speed is also moved by torque that no
model has, and that error stays: the free run's residual wanders, and its least-squares sigmas are several times too
small. Here every interval is predicted from the smoothed speed, one Kalman filter makes the errors independent
(docs/likelihood.md eq. 1-5), and the ratio of the two noises is integrated out (`noise_posterior`). Fitted are the four
parameters and, where the model has effects, their coefficients.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.effects.catalogue import STRIBECK
from rw_ekf.filter import gating
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.consistency import Consistency, consistency_of
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.filter.noise_evenness import unevenness
from rw_ekf.filter.parameters_held import frozen, without_drift
from rw_ekf.likelihood.fitting import Fit, at_standstill
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.noise_posterior import NoisePosterior, noise_posterior
from rw_ekf.likelihood.one_step import Record, state_vector
from rw_ekf.likelihood.robust_fit import read_trajectory, robust_fit, smoothed_by_filter
from rw_ekf.likelihood.structure import structure
from rw_ekf.model.effect import Term
from rw_ekf.model.friction import FAST_STRIBECK_SPEEDS
from rw_ekf.model.state import PARAMETER_COUNT, FrictionParameters
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet

Effort = Literal["least", "usual", "most"]

_SETTLED = 0.5  # standard deviations: the ratio that the last step integrates over is not the one it began with


@dataclass(eq=False, frozen=True)
class LogFit:
    """Parameters of a whole log, noises, and the fit they are linearised at."""

    parameters: FrictionParameters
    effects: EffectSet  # with the coefficients found
    covariance: Float64Array  # (4 + m, 4 + m)
    stribeck_speed_rad_s: float
    stribeck_speed_std: float  # 0 where it was given
    noises: NoisePosterior
    fit: Fit

    @property
    def std(self) -> Float64Array:
        """Standard deviations of the four parameters and the coefficients, (4 + m,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def converged(self) -> bool:
        """Whether the last step is small against what is not known."""
        return _is_small(self.noises)

    @property
    def left_out(self) -> int:
        """Readings that no noise explains."""
        return int(self.fit.omit.sum())


def _is_small(noises: NoisePosterior) -> bool:
    std = np.sqrt(np.maximum(np.diag(noises.covariance), 1.0e-300))
    return bool(np.all(np.abs(noises.correction) < _SETTLED * std))


def fit_log(
    course: Course,
    constants: FilterConstants,
    prior: Belief,
    start: FrictionParameters,
    effects: EffectSet = NO_EFFECTS,
    *,
    stribeck_speed_std: float = 0.0,
    effort: Effort = "usual",
    advance: Callable[[], object] = lambda: None,
) -> LogFit:
    """Fit the four parameters to all of `course` from `start`; constants give R to begin with and the Stribeck curve.

    effects: their coefficients in the state are fitted with the rest, from their values; the prior is then that of a
    model with them. Their shapes stay.
    stribeck_speed_std: where the Stribeck speed is a guess, how far it may be off [rad/s]; it is then fitted too, and
    what is not known of it is in the parameters' covariance. The readings must not be all missing.
    effort: "least" fits along the readings alone, "usual" along the path of the filter with the start's parameters too,
    and keeps the likelier, "most" continues where the steps have not vanished yet; the noises alone can do without.
    """
    noise = float(np.sqrt(constants.speed_variance))
    everything = np.ones(course.samples, dtype=bool)
    record = Record.of(course, everything, constants)
    bare = Model(start, constants.stribeck, EffectSet(tuple(replace(term, settled=True) for term in effects.terms)))
    size = bare.known
    known = Belief.of_known(*prior.known(effects.size), effect_ids=effects.coefficient_ids)
    model, (omega_s, law) = bare, constants.stribeck
    if stribeck_speed_std > 0.0:
        shape = (float(law), 0.0, 0.0)
        free = Term.of(STRIBECK, shape, omega_s, stribeck_speed_std)
        model = bare.with_terms(free)
        known = known.with_coefficient(free.id, omega_s, stribeck_speed_std)
    advance()
    seen = bare.base if effects.table().hidden else bare
    paths = [read_trajectory(course, noise)]
    if effort != "least":
        paths.append(smoothed_by_filter(course, everything, seen, constants, noise))
    fit = robust_fit(record, model, known, noise, paths)
    advance()
    noises = noise_posterior(fit)
    if effort == "most" and not _is_small(noises):
        fit = at_standstill(fit)
        noises = noise_posterior(fit)
    found = fit.model.vector + fit.model.limited(noises.correction)
    fitted = bare.with_vector(found[:size])
    std = np.sqrt(np.maximum(np.diag(noises.covariance)[:size], 0.0))
    return LogFit(
        parameters=fitted.parameters,
        effects=fitted.effects.with_values(fitted.effects.values, std[PARAMETER_COUNT:]),
        covariance=noises.covariance[:size, :size],
        stribeck_speed_rad_s=float(found[size]) if model is not bare else omega_s,
        stribeck_speed_std=float(np.sqrt(noises.covariance[size, size])) if model is not bare else 0.0,
        noises=noises,
        fit=fit,
    )


def consistency_of_fit(fit: LogFit, constants: FilterConstants) -> Consistency:
    """Whether what a fit leaves is noise: whiteness, mean, structure at its own noises; those beside the given ones.

    The first three test whether the model is right whatever the noises are; the last whether the noises that a filter
    was given (constants) are the record's. Kept apart because torque noise large enough explains any model.
    """
    linearised, noises = fit.fit.linearised, fit.noises
    course = linearised.record.course
    ratio = noises.acceleration_noise**2 * course.period_s / noises.speed_noise_rad_s**2
    r, A, _ = linearised.whitened(ratio, noises.speed_noise_rad_s**2, linearised.jacobian, linearised.memory_jacobian)
    left = r - A @ noises.correction
    found = consistency_of(left, np.ones(left.size), np.ones(left.size, dtype=bool))
    if found.whiteness_p is None:
        return found
    speed = fit.fit.trajectory.speed
    resting = np.abs(speed) < FAST_STRIBECK_SPEEDS * constants.stribeck.omega_s  # where a wheel breaks away by chance
    resting[1:] |= resting[:-1].copy()
    away = np.where(resting, 0.0, speed)[linearised.innovation_at]
    coefficients = np.array([*fit.parameters, *fit.effects.values])
    mean, covariance = frozen(fit.parameters, state_vector(coefficients, fit.effects))
    run = filter_log(course, without_drift(constants), mean, covariance, fit.effects)
    consistency = consistency_of(run.innovation_rad_s, run.innovation_variance, run.outcome == gating.UPDATED)
    with_memory = linearised.memory_jacobian.size > 0  # what would be added has no slope by the memory
    p_value = None if with_memory else structure(fit.fit).p_value
    uneven = unevenness(left, away)
    return replace(found, noise_ratio=consistency.noise_ratio, structure_p=p_value, unevenness=uneven)
