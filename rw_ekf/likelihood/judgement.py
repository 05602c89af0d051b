"""Whether what a fit leaves is noise: whiteness, mean, structure at its own noises; those beside the given ones.

The first three ask whether the model is right whatever the noises are; the last whether the noises that a filter was
told are the record's. Kept apart because the one hides the other: torque noise large enough explains any model.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rw_ekf.filter import decisions
from rw_ekf.filter.consistency import Consistency, judge
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.frozen import frozen, without_drift
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.likelihood.log_fit import LogFit
from rw_ekf.likelihood.structure import structure


def judge_fit(fit: LogFit, constants: FilterConstants) -> Consistency:
    """Judge a fit; constants: of the filter whose noises are compared with what was found."""
    frame, noises = fit.fit.frame, fit.noises
    course = frame.record.course
    ratio = noises.acceleration_noise**2 * course.period_s / noises.speed_noise_rad_s**2
    r, A, _ = frame.whitened(ratio, noises.speed_noise_rad_s**2, frame.columns)
    left = r - A @ noises.correction
    found = judge(left, np.ones(left.size), np.ones(left.size, dtype=bool))
    if found.whiteness_p is None:
        return found
    mean, covariance = frozen(fit.parameters)
    run = filter_log(course, without_drift(constants), mean, covariance)
    told = judge(run.innovation_rad_s, run.innovation_variance, run.outcome == decisions.UPDATED)
    return replace(found, noise_ratio=told.noise_ratio, structure_p=structure(fit.fit, fit.prior).p_value)
