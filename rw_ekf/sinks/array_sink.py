"""A replay through the loop as the arrays that the compiled pass would have filled."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from rw_ekf.records import FilterReset, Outcome, Tick

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rw_ekf.arrays import Float64Array
    from rw_ekf.filter.filter_run import FilterRun


class ArraySink:
    """Collects a replay through the loop into the arrays that the compiled pass would have filled."""

    def __init__(self, n: int, advance: Callable[[int], object], size: int) -> None:
        import numpy as np

        from rw_ekf.filter import gating
        from rw_ekf.filter.health_monitor import TROUBLES

        self._codes = {outcome: getattr(gating, outcome.name) for outcome in Outcome}
        self._troubles = {trouble: code for code, trouble in TROUBLES.items()}
        self._row = 0
        self._advance = advance
        self.outcome: NDArray[np.int8] = np.zeros(n, np.int8)
        self.innovation: Float64Array = np.full(n, np.nan)
        self.variance: Float64Array = np.full(n, np.nan)
        self.mended: NDArray[np.int8] = np.zeros(n, np.int8)
        self.states: Float64Array = np.zeros((n, size))
        self.stds: Float64Array = np.zeros((n, size))

    def write(self, tick: Tick) -> None:
        """Take the next row."""
        i = self._row
        estimate = tick.estimate
        self.outcome[i] = self._codes[estimate.outcome]
        health = estimate.health
        if health is not None and health.time_s == estimate.time_s and health.reset is not FilterReset.NOTHING:
            self.mended[i] = self._troubles[health.trouble]
        self.states[i] = estimate.values
        self.stds[i] = estimate.stds
        if estimate.innovation is not None:
            self.innovation[i] = estimate.innovation.innovation_rad_s
            self.variance[i] = estimate.innovation.std_rad_s**2
        self._row = i + 1
        if self._row % 100 == 0:
            self._advance(100)

    def close(self) -> None:
        """Nothing to finish."""

    def as_run(self, mean: Float64Array, covariance: Float64Array) -> FilterRun:
        """Return the run, given the estimator's final belief."""
        from rw_ekf.filter.filter_run import FilterRun, History

        none = History.zeros(0, len(mean))
        return FilterRun(
            mean, covariance, self.innovation, self.variance, self.outcome, self.mended, self.states, self.stds, none
        )
