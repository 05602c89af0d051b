"""A model fitted to all of a log that is too long to be held, part by part, from where its stretches left it.

At the likeliest numbers of the stretches each part of the log says how it would move them: its score s_p and its
information H_p along its own smoothed trajectory. Added up they are a Gauss-Newton step of the whole,

    x <- x + (sum H_p + W'W)^-1 (sum s_p + W'(aim - W x)),                       (docs/likelihood.md eq. 15)

which is the likeliest of all readings after two, for the start is as good as a fit to 50,000 of them. What the parts
say differs by more than their noise where a wheel is not the same for days: their scores are independent, so that their
own scatter shows how well the numbers are known (Huber's and White's sandwich),

    C = H^-1 [P / (P - 1) sum (s_p - mean)(s_p - mean)'] H^-1.                                                (eq. 16)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.course.conditions import filled_columns, held_over
from rw_ekf.course.course import Course
from rw_ekf.diagnosis.hypotheses.confounding import quantity_of
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.prepare.source import gross_errors
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.gauss_newton import SMALL_STEP, smoothed_trajectory
from rw_ekf.likelihood.linearisation import Noise, linearise
from rw_ekf.likelihood.model_vector import Model, prior_rows
from rw_ekf.likelihood.one_step import Record
from rw_ekf.likelihood.robust_fit import smoothed_by_filter
from rw_ekf.logs.long_log import LogPart, LongLog
from rw_ekf.model.effect import REFERENCE_DEGC
from rw_ekf.model.state import MOTOR_GAIN, STATIC

_TURNS = 5  # passes over the log; three as a rule, of which the last finds that nothing moves any more
_SETTLING_TURNS = 2  # of a trajectory, from that of the filter to the likeliest
_LEAST_PARTS = 8  # of whose scatter a variance is made: that of eight is known to a half of itself


@dataclass(eq=False, frozen=True)
class WholeFit:
    """A fit, its numbers and how well they are known those of all of the log; its trajectory that of the stretches."""

    fit: Fit
    parts: int
    scatter: Float64Array  # (p,) of what parts say, in what their noise explains: 1 for a wheel that stays as it is


@dataclass(eq=False, frozen=True)
class _Sums:
    """Scores (P, p) of the parts at one model, and the sum of their information (p, p)."""

    scores: Float64Array
    information: Float64Array


def fitted_to_all(fit: Fit, reported: Fit, prepared: Prepared, log: LongLog) -> WholeFit | None:
    """A fit of stretches taken on to all of a log; None where a part alone cannot say what the whole says.

    reported: the fit with the standard deviations that are reported; by what they exceed those of `fit`, which more
    readings do not mend (a Stribeck speed that nobody knows), the new ones do. That of break-away friction stays no
    smaller than it was: a command that climbs in steps passes it between the same two each time, and the error is the
    same each time (of 224 runs whose ramps climb by 1 % of it the mean was .07 % too high).

    None for a friction with a memory, for what goes by the log's own clock, an angle that nobody logged, rounded
    readings that share an error, and numbers by simulation. Raises UnsoundError where only the whole can be judged,
    LogError as `read_log`.
    """
    if not _is_known_by_parts(fit, reported, prepared):
        return None
    model = fit.model
    W, aim = (np.zeros((0, model.vector.size)), np.zeros(0)) if fit.prior is None else prior_rows(fit.prior, model)
    for _ in range(_TURNS):
        sums = _sums(fit, model, prepared, log)
        if sums is None:
            return None
        try:
            inverse = np.linalg.inv(sums.information + W.T @ W)
        except np.linalg.LinAlgError:
            return None
        inverse = 0.5 * (inverse + inverse.T)
        step = inverse @ (sums.scores.sum(axis=0) + W.T @ (aim - W @ model.vector))
        model = model.with_vector(model.vector + model.limited(step))
        if bool(np.all(np.abs(step) < SMALL_STEP * np.sqrt(np.diag(inverse)))):
            break
    else:
        return None
    parts, known = sums.scores.shape[0], np.sqrt(np.diag(inverse))
    scatter, covariance = np.ones(known.size), inverse
    if parts >= _LEAST_PARTS:
        apart = sums.scores - sums.scores.mean(axis=0)
        observed = inverse @ (apart.T @ apart * (parts / (parts - 1.0))) @ inverse
        scatter = np.sqrt(np.maximum(np.diag(observed), 0.0)) / known
        covariance = inverse * np.outer(np.maximum(scatter, 1.0), np.maximum(scatter, 1.0))
    beyond = np.maximum(np.diag(reported.likelihood.covariance - fit.likelihood.covariance), 0.0)
    static = STATIC - MOTOR_GAIN
    beyond[static] = max(beyond[static], reported.likelihood.covariance[static, static] - covariance[static, static])
    likelihood = replace(fit.likelihood, covariance=covariance + np.diag(beyond))
    return WholeFit(replace(fit, model=model, likelihood=likelihood), parts, scatter)


def _is_known_by_parts(fit: Fit, reported: Fit, prepared: Prepared) -> bool:
    model = fit.model
    effects = [term.effect for term in model.effects.terms]
    quantities = [term.law.quantity for term in model.terms if term.law is not None]
    angular = any(effect.angular for effect in effects) or "angle" in quantities
    return not (
        model.has_memory
        or model.effects.table().hidden
        or reported.simulated
        or prepared.temperature_lag is not None  # which continues from part to part
        or fit.linearised.record.levels is not None
        or any(quantity_of(effect) == "time" or effect.local_in_time for effect in effects)
        or "time" in quantities
        or (angular and not prepared.angle_is_logged)
    )


def _sums(fit: Fit, model: Model, prepared: Prepared, log: LongLog) -> _Sums | None:
    """Go through the log once, but for parts without a reading; None where what one teaches cannot be computed."""
    size = model.vector.size
    scores, information = [], np.zeros((size, size))
    for part in log.parts(again=True):
        course, inside = _course_of(part, prepared)
        if not np.any(np.isfinite(course.speed_rad_s[inside])):
            continue
        found = _score(fit, model, Record.of(course, inside, fit.linearised.record.constants), inside)
        if found is None:
            return None
        scores.append(found[0])
        information += found[1]
    return _Sums(np.array(scores), information) if scores else None


def _course_of(part: LogPart, prepared: Prepared) -> tuple[Course, BoolArray]:
    """A part as filters read it, its conditions filled, and which of its rows are its own: others stand in front."""
    course = Course.of_log(part.log, prepared.source.columns)
    wrong = gross_errors(course.speed_rad_s, course.segment)
    speed = np.where(wrong, np.nan, course.speed_rad_s)
    temperature, angle = course.temperature_degC, course.angle_rad
    course = course._replace(
        speed_rad_s=speed,
        temperature_degC=_held(temperature, REFERENCE_DEGC, logged=prepared.temperature_is_logged),
        angle_rad=_held(angle, 0.0, logged=prepared.angle_is_logged),
        columns=filled_columns(course.columns),
    )
    inside = np.arange(course.samples) >= part.begin
    return course, inside


def _held(values: Float64Array, otherwise: float, *, logged: bool) -> Float64Array:
    """A channel (n,) of a part without gaps, however few values the part has, if the log has it; else `otherwise`."""
    return held_over(values) if logged and np.isfinite(values).any() else np.full(values.size, otherwise)


def _score(fit: Fit, model: Model, record: Record, inside: BoolArray) -> tuple[Float64Array, Float64Array] | None:
    """What one part says: the slope of its log-likelihood by the vector (p,), and its information (p, p)."""
    noise = Noise(fit.noise.variance, fit.noise.ratio * record.period_s / fit.linearised.record.period_s)
    none, omit = np.zeros(0), ~np.isfinite(record.course.speed_rad_s)
    # Near rest only a model distinguishes stick from slip.
    trajectory = smoothed_by_filter(record.course, inside, model, record.constants, float(np.sqrt(noise.variance)))
    for _ in range(_SETTLING_TURNS):
        followed = linearise(record, model, trajectory, noise, omit, with_jacobian=False)
        trajectory = smoothed_trajectory(followed, none, noise)
    linearised = linearise(record, model, trajectory, noise, omit)
    sums, _, _ = linearised.whitened_sums(noise.ratio, noise.variance, linearised.jacobian, None)
    return (sums[:-1, -1], sums[:-1, :-1]) if np.all(np.isfinite(sums)) else None
