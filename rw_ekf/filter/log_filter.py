"""Filter a whole log with the compiled pass, and keep what was asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.errors import FilterError
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.current_schedule import Pieces, begins_of_pieces, pieces_of_log
from rw_ekf.filter.kernel import filter_pass, filter_pass_with_effects
from rw_ekf.model.state import STATE_SIZE
from rw_ekf.wheel.table import NO_EFFECTS, EffectSet

_PERIOD_SAMPLES = 100_000


@dataclass(frozen=True)
class FilterInput:
    """A log as the filter sees it: (n,) arrays in SI, NaN for a missing speed, and the pieces of current between."""

    time_s: Float64Array
    speed_rad_s: Float64Array
    segment: Int64Array
    pieces: Pieces
    temperature_degC: Float64Array | None = None  # NaN where it was not read
    angle_rad: Float64Array | None = None

    @classmethod
    def of(
        cls,
        time_s: Float64Array,
        speed_rad_s: Float64Array,
        current_A: Float64Array,
        command_delay_s: Float64Array | None = None,
        segment: Int64Array | None = None,
        temperature_degC: Float64Array | None = None,
        angle_rad: Float64Array | None = None,
    ) -> FilterInput:
        """Build from columns; delay and segment default to zero; temperature and angle only effects read."""
        delay = np.zeros(time_s.size) if command_delay_s is None else command_delay_s
        part = np.zeros(time_s.size, np.int64) if segment is None else segment
        pieces = pieces_of_log(time_s, current_A, delay, part)
        return cls(time_s, speed_rad_s, part, pieces, temperature_degC, angle_rad)

    @property
    def period_s(self) -> float:
        """Median step within segments, of the first 100,000 samples [s]; 0.1 where there is no step."""
        step_s = np.diff(self.time_s[:_PERIOD_SAMPLES])[np.diff(self.segment[:_PERIOD_SAMPLES]) == 0]
        return float(np.median(step_s)) if step_s.size else 0.1

    def head(self, n: int) -> FilterInput:
        """The first n samples, or all where there are fewer."""
        if self.time_s.size <= n:
            return self
        last = max(int(self.pieces.start[n]), 1)  # pieces of samples that are gone would begin at no time
        return FilterInput(
            self.time_s[:n],
            self.speed_rad_s[:n],
            self.segment[:n],
            Pieces(self.pieces.start[:n], self.pieces.duration_s[:last], self.pieces.current_A[:last]),
            None if self.temperature_degC is None else self.temperature_degC[:n],
            None if self.angle_rad is None else self.angle_rad[:n],
        )

    def window(self, first: int, last: int) -> FilterInput:
        """Samples first <= i < last alone, with the pieces of current between them."""
        start = self.pieces.start
        begin = int(start[first]) if first < start.size else self.pieces.duration_s.size
        end = int(start[last]) if last < start.size else self.pieces.duration_s.size
        return FilterInput(
            self.time_s[first:last],
            self.speed_rad_s[first:last],
            self.segment[first:last],
            Pieces(start[first:last] - begin, self.pieces.duration_s[begin:end], self.pieces.current_A[begin:end]),
            None if self.temperature_degC is None else self.temperature_degC[first:last],
            None if self.angle_rad is None else self.angle_rad[first:last],
        )

    @property
    def mean_current_A(self) -> Float64Array:
        """Mean current over the interval that led to each sample [A], (n,); 0 where none did."""
        charge = np.concatenate(([0.0], np.cumsum(self.pieces.duration_s * self.pieces.current_A)))
        length = np.concatenate(([0.0], np.cumsum(self.pieces.duration_s)))
        edge = np.minimum(self.pieces.start[: self.time_s.size], self.pieces.duration_s.size)
        passed = np.diff(length[edge], prepend=0.0)
        return np.where(passed > 0.0, np.diff(charge[edge], prepend=0.0) / np.where(passed > 0.0, passed, 1.0), 0.0)

    def with_speed(self, speed_rad_s: Float64Array) -> FilterInput:
        """The same log with other readings (n,); NaN is a missing one."""
        return replace(self, speed_rad_s=speed_rad_s)

    def surroundings(self) -> tuple[Float64Array, Float64Array, Float64Array]:
        """What effects read besides: begins of the pieces [s], temperature (n,) and angle (n,), NaN where not known."""
        unknown = np.full(self.time_s.size, np.nan)
        return (
            begins_of_pieces(self.time_s, self.pieces),
            unknown if self.temperature_degC is None else self.temperature_degC,
            unknown if self.angle_rad is None else self.angle_rad,
        )


@dataclass(frozen=True)
class History:
    """Everything a smoother needs, (n, ...) arrays: predictions, transition rows, process noise."""

    predicted: Float64Array  # (n, m) before the update
    covariance: Float64Array  # (n, m, m) before the update
    row: Float64Array  # (n, m) first row of F of the step that led to sample i
    noise: Float64Array  # (n, m) diagonal of Q of that step


@dataclass(frozen=True)
class FilterRun:
    """What the pass leaves: the final belief, the innovations, and histories where they were asked for."""

    mean: Float64Array  # (m,) for m states
    covariance: Float64Array  # (m, m)
    innovation_rad_s: Float64Array  # (n,) NaN where there was none
    innovation_variance: Float64Array  # (n,)
    outcome: NDArray[np.int8]  # (n,) codes of rw_ekf.filter.decisions
    states: Float64Array  # (n, m) or (0, m)
    stds: Float64Array  # (n, m) or (0, m)
    history: History | None

    @property
    def nis(self) -> Float64Array:
        """Normalised innovation squared, (n,) [-]."""
        with np.errstate(over="ignore"):  # a model that runs away misses by more than a double can square
            return self.innovation_rad_s**2 / self.innovation_variance


def filter_log(
    data: FilterInput,
    constants: FilterConstants,
    mean: Float64Array,
    covariance: Float64Array,
    effects: EffectSet = NO_EFFECTS,
    drift: Float64Array | None = None,
    *,
    keep_states: bool = False,
    keep_history: bool = False,
) -> FilterRun:
    """Run the filter over `data` from the belief (mean (n,), covariance (n, n)); neither is changed.

    n is 5, and with `effects` their coefficients and hidden states more; drift: the coefficients' variance rates. The
    speed of `mean` is replaced by the first reading. Raises FilterError when the input or the result is not finite.
    """
    n = data.time_s.size
    if not np.isfinite(data.pieces.current_A).all() or np.isinf(data.speed_rad_s).any():
        raise FilterError(
            "the log holds a current or a speed that is not finite (a missing speed is NaN, no current is)"
        )
    x = np.array(mean, dtype=np.float64)
    P = np.array(covariance, dtype=np.float64)
    table = effects.table(drift)
    size = table.size
    with_effects = size > STATE_SIZE
    if x.shape != (size,) or P.shape != (size, size):
        raise FilterError(f"the model has {size} states, the belief {x.shape} and {P.shape}")
    nothing = np.zeros(0)
    begins, temperature, angle = data.surroundings() if with_effects else (nothing, nothing, nothing)
    if effects.reading_variance > 0.0:
        constants = constants._replace(speed_variance=constants.speed_variance + effects.reading_variance)
    innovation = np.empty(n)
    variance = np.empty(n)
    outcome = np.empty(n, np.int8)
    kept = n if keep_states else 0
    states, stds = np.empty((kept, size)), np.empty((kept, size))
    full = n if keep_history else 0
    history = History(
        np.zeros((full, size)), np.zeros((full, size, size)), np.zeros((full, size)), np.zeros((full, size))
    )
    (filter_pass_with_effects if with_effects else filter_pass)(
        constants,
        table if with_effects else None,
        data.time_s,
        data.speed_rad_s,
        data.segment,
        data.pieces.start,
        data.pieces.duration_s,
        data.pieces.current_A,
        begins,
        temperature,
        angle,
        x,
        P,
        innovation,
        variance,
        outcome,
        states,
        stds,
        history.row,
        history.predicted,
        history.covariance,
        history.noise,
    )
    if not (np.isfinite(x).all() and np.isfinite(P).all()):
        raise FilterError(
            f"the filter's state is no longer finite after {n} samples: {x}. Look for wild values in the log's speed "
            "or current, or give a prior nearer to the plant (--config, --prior)."
        )
    return FilterRun(x, P, innovation, variance, outcome, states, stds, history if keep_history else None)
