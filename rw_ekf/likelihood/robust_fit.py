"""A model fitted along several trajectories, the likeliest kept, and readings that no noise explains left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rw_ekf.arrays import BoolArray
from rw_ekf.course.conditions import bridged
from rw_ekf.course.course import Course
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.smoother import smooth_log
from rw_ekf.identify.least_squares import OUTLIER_SHARE, OUTLIER_STDS
from rw_ekf.likelihood.filter_over_record import run_frozen
from rw_ekf.likelihood.fitting import Fit, fit_model
from rw_ekf.likelihood.gauss_newton import Problem, Start
from rw_ekf.likelihood.linearisation import Noise
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import LEAST_SPREAD, Record, Trajectory
from rw_ekf.model.state import PARAMETER_NAMES, SPEED

_FILTER_RATIO = 1.0e-3  # q dt / R
_SURELY, _LATER = 3.0, 1.1  # sigmas of break-away friction, and times Coulomb friction


def read_trajectory(course: Course, noise_rad_s: float) -> Trajectory:
    """The readings themselves, gaps bridged: no model has had a say in them."""
    return Trajectory.of_speed(bridged(course.speed_rad_s), np.full(course.samples, noise_rad_s))


def smoothed_by_filter(
    course: Course, part: BoolArray, model: Model, constants: FilterConstants, noise_rad_s: float
) -> Trajectory:
    """The speed smoothed by the filter itself, its parameters frozen: near rest only a model separates stick from slip.

    model: without hidden states. Readings outside `part` (n,) are not looked at.
    """
    run = run_frozen(course.only(part), model, Noise(noise_rad_s**2, _FILTER_RATIO), constants, keep_history=True)
    means, stds = smooth_log(run)
    return Trajectory.of_speed(means[:, SPEED], np.maximum(stds[:, SPEED], LEAST_SPREAD * noise_rad_s))


def robust_fit(record: Record, model: Model, prior: Belief, noise_rad_s: float, starts: list[Trajectory]) -> Fit:
    """Fit from each trajectory, keep the likeliest, leave out the readings that no noise explains, and fit again."""
    n = record.course.time_s.size
    noise = Noise(noise_rad_s**2, 1.0e-2)
    none = np.zeros(n, dtype=bool)
    fits = [fit_model(Problem(record, prior, none), Start(model, trajectory, noise)) for trajectory in starts]
    fit = max(fits, key=lambda item: item.likelihood.value)
    spikes = outliers(fit)
    if spikes.any() and spikes.sum() <= OUTLIER_SHARE * n:
        start = Start(fit.model, fit.trajectory, noise)  # not its own noise, which had the spikes in it
        return fit_model(Problem(record, prior, spikes), start)
    return fit


def likelier_along_filter(fit: Fit, start: Fit, model: Model) -> Fit:
    """A fit, or one of `model` along the path of its own filter, if that is likelier: near rest there are two valleys.

    Both are of the part of `start`; a model with hidden states has no such path.
    """
    if model.effects.table().hidden:
        return fit
    record = start.linearised.record
    part = record.follows | np.append(record.follows[1:], False)
    noise = float(np.sqrt(start.noise.variance))
    path = smoothed_by_filter(record.course, part & ~start.omit, model, record.constants, noise)
    other = fit_model(start.problem, Start(model, path, start.noise))
    return max(fit, other, key=lambda item: item.likelihood.value)


def with_later_break_away(fit: Fit) -> Fit:
    """A fit, or a likelier one begun with more break-away than Coulomb friction, where it surely ended with less.

    What an asymmetry or a torque does to the free run of least squares may be taken for a wheel that never sticks; no
    trajectory smoothed with that leads out of it.
    """
    static, coulomb = fit.model.parameters.static, fit.model.parameters.coulomb
    if static > coulomb - _SURELY * fit.std[PARAMETER_NAMES.index("static")]:
        return fit
    later = replace(fit.model, parameters=fit.model.parameters._replace(static=_LATER * coulomb))
    return likelier_along_filter(fit, fit, later)


def outliers(fit: Fit) -> BoolArray:
    """Readings beyond six standard deviations of what the model predicts, (n,)."""
    none = np.zeros((fit.linearised.chain.reading.size, 0))
    r, _, _ = fit.linearised.whitened(fit.noise.ratio, fit.noise.variance, none)
    found = np.zeros(fit.linearised.chain.reading.size, dtype=bool)
    found[fit.linearised.innovation_at] = np.abs(r) > OUTLIER_STDS
    return found
