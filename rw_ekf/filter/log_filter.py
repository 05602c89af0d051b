"""Filter a whole log with the compiled pass, and keep what was asked for."""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.errors import FilterError
from rw_ekf.filter import decisions
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.kernel import filter_pass, filter_pass_with_effects
from rw_ekf.filter.step import memory_of
from rw_ekf.model.state import STATE_SIZE
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet


def filter_log(
    course: Course,
    constants: FilterConstants,
    mean: Float64Array,
    covariance: Float64Array,
    effects: EffectSet = NO_EFFECTS,
    drift: Float64Array | None = None,
    *,
    keep_states: bool = False,
    keep_history: bool = False,
    mends: bool = False,
) -> FilterRun:
    """Run the filter over `course` from the belief (mean (m,), covariance (m, m)); neither is changed.

    m is 5, and with `effects` their coefficients and hidden states more; drift: the coefficients' variance rates. The
    speed of `mean` is replaced by the first reading. mends: reset a filter that breaks, as the daemon does
    (docs/filter.md, "Health"). Raises FilterError when the input or the result is not finite.
    """
    if not np.isfinite(course.pieces.current_A).all() or np.isinf(course.speed_rad_s).any():
        raise FilterError(
            "the log holds a current or a speed that is not finite (a missing speed is NaN, no current is)"
        )
    run = FilterRun.empty(mean, covariance, course.samples, states=keep_states, history=keep_history)
    table = effects.table(drift)
    if run.mean.shape != (table.size,) or run.covariance.shape != (table.size, table.size):
        raise FilterError(f"the model has {table.size} states, the belief {run.mean.shape} and {run.covariance.shape}")
    if effects.reading_variance > 0.0:
        constants = constants._replace(speed_variance=constants.speed_variance + effects.reading_variance)
    known = table if table.size > STATE_SIZE else None
    memory = memory_of(run.mean, run.covariance, constants, known, mends=mends)
    (filter_pass if known is None else filter_pass_with_effects)(constants, known, course, run, memory)
    if not (np.isfinite(run.mean).all() and np.isfinite(run.covariance).all()):
        raise FilterError(
            f"the filter's state is no longer finite after {course.samples} samples: {run.mean}. Look for wild values "
            "in the log's speed or current, or give a prior nearer to the plant (--config, --prior)."
        )
    return run


def log_likelihood_of(run: FilterRun) -> float:
    """Of the readings that were used, each given those before it (the prediction error decomposition)."""
    used = run.outcome == decisions.UPDATED
    variance = run.innovation_variance[used]
    return float(-0.5 * np.sum(np.log(2.0 * np.pi * variance) + run.innovation_rad_s[used] ** 2 / variance))
