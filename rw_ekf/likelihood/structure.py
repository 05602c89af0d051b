"""Is there structure beside what is fitted? One joint test of what wheels usually lack.

A wrong model pays in process noise, and once a filter is given that noise its innovations look like innovations
should. So the question is not whether they are white, but whether a few more regressors would make the readings
clearly likelier, each side at its own best ratio of noises (docs/likelihood.md eq. 6a). They are those of the commonest
effects; which of them it is, `rw-ekf diagnose` has to say.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.effects.catalogue import TORQUE
from rw_ekf.filter.tails import chi_square_tail
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model_vector import prior_rows
from rw_ekf.likelihood.one_step import predict
from rw_ekf.likelihood.profile import LEAST_RATIO
from rw_ekf.model.effect import Term
from rw_ekf.model.state import COULOMB, STATE_SIZE, STATIC
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet

_INFLATION = 1.15  # of such statistics on healthy wheels, over chi-square (docs/diagnosis-proof.md)
_RATIOS_BELOW = 8  # factors of e^1.2 below the fit's own: what a regressor explains is no process noise any more
_STEP = 1.2
_TURNING = 2.0  # Stribeck speeds: below, what torque noise does to a wheel that may stop at any moment is not linear
_NUDGE = 1.0e-6  # of the largest torque, for a difference: its own bend is as far below as the rounding of speeds
_OWN_SHARE = 0.05  # of a regressor's length that the parameters cannot follow: less says nothing


@dataclass(frozen=True)
class Structure:
    """Outcome of the joint test; p None where no regressor says anything of its own."""

    statistic: float
    freedom: int
    p_value: float | None


def slopes_by_torque(fit: Fit) -> tuple[Float64Array, Float64Array]:
    """Slopes of each one-step prediction by a torque and by dry friction, (n,) each, at the sample it leads to."""
    model = fit.model
    probe = EffectSet((Term.of(TORQUE),))
    rows = predict(
        fit.linearised.record, np.array([*model.parameters, 0.0]), probe, model.stribeck, fit.trajectory,
        with_rows=True, with_slopes=False,
    ).rows  # fmt: skip
    return -rows[:, STATE_SIZE], rows[:, COULOMB] + rows[:, STATIC]


def _slopes_away_from_rest(fit: Fit) -> tuple[Float64Array, Float64Array]:
    """The same where a wheel slips all along, without the routines for effects, which only a diagnosis has compiled.

    A torque is what the motor drives with: of a gain of 1 a current that is k I and a little more, or less. Where a
    wheel stops or breaks away within an interval such a difference is not the slope that a diagnosis goes by.
    """
    record, parameters, stribeck = fit.linearised.record, fit.model.parameters, fit.model.stribeck
    pieces = record.course.pieces
    drive = parameters.motor_gain * pieces.current_A  # [rad/s^2]
    h = _NUDGE * max(parameters.coulomb, float(np.max(np.abs(drive), initial=0.0)), 1.0e-9)
    by_torque = np.array(parameters._replace(motor_gain=1.0))

    def end(nudge: float) -> Float64Array:
        nudged = replace(record, course=record.course._replace(pieces=pieces._replace(current_A=drive + nudge)))
        return predict(nudged, by_torque, NO_EFFECTS, stribeck, fit.trajectory, with_slopes=False).end

    rows = predict(
        record, np.array(parameters), NO_EFFECTS, stribeck, fit.trajectory, with_rows=True, with_slopes=False
    ).rows
    return (end(h) - end(-h)) / (2.0 * h), rows[:, COULOMB] + rows[:, STATIC]


def where_begun(values: Float64Array) -> Float64Array:
    """A quantity (n,) where the interval that leads to each sample began."""
    return np.concatenate((values[:1], values[:-1]))


def hats(values: Float64Array, count: int, low: float, high: float) -> Float64Array:
    """Piecewise linear functions on `count` even knots from low to high, (n, count); constant beyond the ends."""
    knots = np.linspace(low, high, count)
    place = np.clip((values - low) / max(high - low, 1.0e-300) * (count - 1), 0.0, count - 1.0)
    return np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(knots.size)))


def structure(fit: Fit, wanted: Float64Array | None = None) -> Structure:
    """Test the fit of a model without friction that has a memory for what would add to it.

    wanted: slopes (n, m) of each one-step prediction by what is to be tested; None: by what the commonest effects add.
    """
    linearised = fit.linearised
    extra = _regressors(fit) if wanted is None else wanted
    best_with, best_without = -math.inf, -math.inf
    with_value, without_value = 0.0, 0.0
    combine = np.zeros((0, 0))
    pull = np.zeros((0, fit.model.vector.size)) if fit.prior is None else prior_rows(fit.prior, fit.model)[0]
    own = linearised.jacobian.shape[1]
    for number in range(_RATIOS_BELOW + 1):
        ratio = max(fit.noise.ratio * math.exp(-_STEP * number), LEAST_RATIO)
        r, A, logs = linearised.whitened(ratio, fit.noise.variance, np.column_stack((linearised.jacobian, extra)))
        beside, left, sizes = _beside(A[:, :own], A[:, own:], r, pull)
        if number == 0:
            combine = _combination(beside, np.linalg.norm(A[:, own:], axis=0))
            if combine.shape[1] == 0:
                return Structure(0.0, 0, None)
        freedom = combine.shape[1]
        triangle = np.asarray(np.linalg.qr(np.column_stack((beside @ combine, left)), mode="r"))
        rss = float(left @ left)
        value = _value(rss, r.size, logs)
        merit = value - sizes + 0.5 * own * math.log(max(rss, 1.0e-12) / r.size)
        if merit > best_without:
            best_without, without_value = merit, value
        rss = float(triangle[freedom, freedom]) ** 2
        value = _value(rss, r.size, logs)
        merit = value - sizes + 0.5 * (own + freedom) * math.log(max(rss, 1.0e-12) / r.size)
        merit -= float(np.sum(np.log(np.abs(np.diag(triangle)[:freedom]))))
        if merit > best_with:
            best_with, with_value = merit, value
        if ratio == LEAST_RATIO:
            break
    statistic = max(2.0 * (with_value - without_value), 0.0)
    return Structure(statistic, combine.shape[1], chi_square_tail(statistic / _INFLATION, combine.shape[1]))


def _value(rss: float, count: int, logs: float) -> float:
    """Log-likelihood, but for a constant, with R at its best."""
    return -0.5 * (count * math.log(max(rss, 1.0e-12) / count) + logs)


def _beside(
    own: Float64Array, more: Float64Array, r: Float64Array, pull: Float64Array
) -> tuple[Float64Array, Float64Array, float]:
    """What of the regressors `more` (n, m) and of r (n,) the model's own (n, p) leave: (m + 1, m) and (m + 1,).

    In the coordinates of one orthogonal triangularisation, in which lengths and angles are what they were. With them
    half the log-determinant of the information of the model's own, its prior's rows `pull` (k, p) among it.
    """
    seen = np.linalg.norm(own, axis=0) > 0.0
    p = int(np.count_nonzero(seen))
    R = np.asarray(np.linalg.qr(np.column_stack((own[:, seen], more, r)), mode="r"))
    known = np.zeros((p, own.shape[1]))
    known[:, seen] = R[:p, :p]
    diagonal = np.abs(np.diag(np.asarray(np.linalg.qr(np.vstack((known, pull)), mode="r"))))
    return R[p:, p:-1], R[p:, -1], float(np.sum(np.log(np.maximum(diagonal, 1.0e-300))))


def _combination(beside: Float64Array, lengths: Float64Array) -> Float64Array:
    """Combinations (m, freedom) of regressors of these lengths (m,) that the model's own cannot follow."""
    keep = np.linalg.norm(beside, axis=0) > _OWN_SHARE * np.maximum(lengths, 1.0e-300)
    _, spread, T = np.linalg.svd(beside[:, keep] / lengths[keep], full_matrices=False)
    reported = spread > _OWN_SHARE
    found = np.zeros((beside.shape[1], int(np.count_nonzero(reported))))
    found[keep] = (T[reported].T / spread[reported]) / lengths[keep][:, None]
    return found


def _regressors(fit: Fit) -> Float64Array:
    """One-step slopes by what is tried, (n, m): torques and dry frictions that depend on speed, current and time."""
    drive, dry = _slopes_away_from_rest(fit)
    record, model = fit.linearised.record, fit.model
    n = drive.size
    speed = where_begun(fit.trajectory.speed)
    size = np.abs(speed)
    top = max(float(np.quantile(size, 0.99)), 1.0e-9)
    current = record.course.mean_current_A
    change = np.diff(current, prepend=current[:1])
    change[~record.follows] = 0.0
    time = np.linspace(-1.0, 1.0, n)
    found = [
        drive,  # a constant torque
        drive * size,  # viscous friction that differs by direction
        drive * np.abs(speed) * speed / top,  # windage
        drive * speed**3 / top**2,
        drive * current * np.abs(current),  # saturation
        drive * change,  # a delay, a lag
        dry * time,  # friction that drifts
    ]
    warmth = record.course.temperature_degC
    if np.isfinite(warmth).sum() > n // 2:
        warmer = np.where(np.isfinite(warmth), warmth - np.nanmean(warmth), 0.0)
        if np.ptp(warmer) > 0.5:
            found += [dry * warmer, drive * speed * warmer, drive * current * warmer]
    regressors = np.column_stack(found)
    regressors[~record.follows | (size < _TURNING * model.stribeck.omega_s)] = 0.0
    return np.ascontiguousarray(regressors[:, np.any(regressors != 0.0, axis=0)])
