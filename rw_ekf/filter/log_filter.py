"""Filter a whole log with the compiled pass, and keep what was requested."""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.errors import FilterError
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.kernel import filter_pass, filter_pass_with_effects, nothing_past
from rw_ekf.filter.step import memory_of
from rw_ekf.model.state import STATE_SIZE
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet


class LogFilter:
    """The compiled pass, which continues from one part of a log to the next: a log need not be held as a whole."""

    def __init__(
        self,
        constants: FilterConstants,
        mean: Float64Array,
        covariance: Float64Array,
        effects: EffectSet = NO_EFFECTS,
        drift: Float64Array | None = None,
        *,
        mends: bool = False,
    ) -> None:
        """Begin with the belief (mean (m,), covariance (m, m)), which is not changed; the rest as in `filter_log`."""
        table = effects.table(drift)
        if mean.shape != (table.size,) or covariance.shape != (table.size, table.size):
            raise FilterError(f"the model has {table.size} states, the belief {mean.shape} and {covariance.shape}")
        if effects.reading_variance > 0.0:
            constants = constants._replace(speed_variance=constants.speed_variance + effects.reading_variance)
        self.mean, self.covariance = np.array(mean, dtype=np.float64), np.array(covariance, dtype=np.float64)
        self._constants, self._table = constants, table if table.size > STATE_SIZE else None
        self._memory = memory_of(self.mean, self.covariance, constants, self._table, mends=mends)
        self._past = nothing_past()

    def over(
        self, course: Course, begin: int = 0, *, keep_states: bool = False, keep_history: bool = False
    ) -> FilterRun:
        """Filter the samples of a part from `begin` on; those before are the last of the part before.

        What is left of these in the run has no meaning. Its belief is that of this object, and keeps changing. Raises
        FilterError when the input or the result is not finite.
        """
        if not np.isfinite(course.pieces.current_A).all() or np.isinf(course.speed_rad_s).any():
            raise FilterError(
                "the log holds a current or a speed that is not finite (a missing speed is NaN, no current is)"
            )
        run = FilterRun.over(self.mean, self.covariance, course.samples, states=keep_states, history=keep_history)
        kernel = filter_pass if self._table is None else filter_pass_with_effects
        kernel(self._constants, self._table, course, run, self._memory, self._past, begin)
        if not (np.isfinite(run.mean).all() and np.isfinite(run.covariance).all()):
            raise FilterError(
                f"the filter's state is no longer finite after {course.samples} samples: {run.mean}. Look for wild "
                "values in the log's speed or current, or give a prior nearer to the plant (--config, --prior)."
            )
        return run


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
    begun = LogFilter(constants, mean, covariance, effects, drift, mends=mends)
    return begun.over(course, keep_states=keep_states, keep_history=keep_history)
