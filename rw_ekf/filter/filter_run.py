"""What a filter leaves of a log: named tuples of arrays that the compiled pass fills as they stand."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rw_ekf.arrays import Float64Array, by_identity


@by_identity
class History(NamedTuple):
    """Everything a smoother needs of n samples and m states; no rows where it was not requested."""

    predicted: Float64Array  # (n, m) before the update
    covariance: Float64Array  # (n, m, m) before the update
    row: Float64Array  # (n, m) first row of F of the step that led to sample i
    noise: Float64Array  # (n, m) diagonal of Q of that step

    @classmethod
    def zeros(cls, n: int, m: int) -> History:
        """Room for n samples and m states."""
        return cls(np.zeros((n, m)), np.zeros((n, m, m)), np.zeros((n, m)), np.zeros((n, m)))


@by_identity
class FilterRun(NamedTuple):
    """The final belief, the innovations, and states and histories where they were requested."""

    mean: Float64Array  # (m,) for m states
    covariance: Float64Array  # (m, m)
    innovation_rad_s: Float64Array  # (n,) NaN where there was none
    innovation_variance: Float64Array  # (n,)
    outcome: NDArray[np.int8]  # (n,) codes of rw_ekf.filter.gating
    mended: NDArray[np.int8]  # (n,) why the filter was reset at a sample, a code of rw_ekf.filter.health; mostly WELL
    states: Float64Array  # (n, m) or (0, m)
    stds: Float64Array  # (n, m) or (0, m)
    history: History

    @classmethod
    def empty(
        cls, mean: Float64Array, covariance: Float64Array, n: int, *, states: bool = False, history: bool = False
    ) -> FilterRun:
        """Room for n samples from a belief, which is copied."""
        mean, covariance = np.array(mean, dtype=np.float64), np.array(covariance, dtype=np.float64)
        return cls.over(mean, covariance, n, states=states, history=history)

    @classmethod
    def over(
        cls, mean: Float64Array, covariance: Float64Array, n: int, *, states: bool = False, history: bool = False
    ) -> FilterRun:
        """Room for n samples from a belief, which will be that after them."""
        m, kept = len(mean), n if states else 0
        return cls(
            mean=mean,
            covariance=covariance,
            innovation_rad_s=np.empty(n),
            innovation_variance=np.empty(n),
            outcome=np.empty(n, np.int8),
            mended=np.zeros(n, np.int8),
            states=np.empty((kept, m)),
            stds=np.empty((kept, m)),
            history=History.zeros(n if history else 0, m),
        )

    def since(self, begin: int) -> FilterRun:
        """What is left of the samples from `begin` on, without histories."""
        return self._replace(
            states=self.states[begin:],
            stds=self.stds[begin:],
            innovation_rad_s=self.innovation_rad_s[begin:],
            innovation_variance=self.innovation_variance[begin:],
            outcome=self.outcome[begin:],
            mended=self.mended[begin:],
        )

    @property
    def nis(self) -> Float64Array:
        """Normalised innovation squared, (n,) [-]."""
        with np.errstate(over="ignore"):  # a model that runs away misses by more than a double can square
            return self.innovation_rad_s**2 / self.innovation_variance
