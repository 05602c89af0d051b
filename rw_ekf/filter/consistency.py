"""Is the residual noise? Tests of the innovations, each with its false-alarm rate (docs/filter.md eq. 13-15).

Judged are the innovations of a second pass with the parameters frozen at the estimate: a filter that may still move its
parameters absorbs what the model lacks, and its innovations look white long after they have stopped being honest.
Whiteness and mean are scaled by the spread found, so that a mistaken speed noise alone raises neither.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.filter.tails import chi_square_tail, gamma_tail

FALSE_ALARM = 1.0e-3  # of the verdict as a whole, over whiteness and mean
# Of the joint test for what the commonest effects would add: short records with much torque noise reach 1e-5 by chance.
STRUCTURE_P = 1.0e-6
_LEAST_SKEWNESS = 0.05
_ALIKE = 1.0e-9  # of their size: draws that differ by no more differ by rounding, and have no tail
_LAGS = 20
MIN_SAMPLES = 100
_NOISE_TOLERANCE = 0.25  # a speed noise wrong by more than this is worth a word


@dataclass(frozen=True)
class Consistency:
    """Outcome of the tests; None where there were too few samples."""

    samples: int
    whiteness_p: float | None  # Ljung-Box over 20 lags
    mean_p: float | None
    largest_correlation: float | None  # autocorrelation of largest size within the lags
    largest_lag: int | None
    noise_ratio: float | None  # spread found over spread expected
    unevenness: str | None = None  # of the noise, in a sentence (rw_ekf.filter.noise_evenness)
    structure_p: float | None = None  # that a wheel of four parameters shows as much (rw_ekf.likelihood.structure)

    @property
    def is_noise(self) -> bool | None:
        """False: the residual has structure; None: cannot be judged."""
        if self.whiteness_p is None or self.mean_p is None:
            return None
        return min(self.whiteness_p, self.mean_p) > 0.5 * FALSE_ALARM and not self._structured

    @property
    def is_clearly_noise(self) -> bool:
        """Whether it is noise by ten times the least that would do: one healthy log in a hundred is not."""
        return bool(self.is_noise) and min(self.whiteness_p or 0.0, self.mean_p or 0.0) > 5.0 * FALSE_ALARM

    @property
    def _structured(self) -> bool:
        return self.structure_p is not None and self.structure_p < STRUCTURE_P

    def warnings(self) -> list[str]:
        """Sentences for a user; empty where all is well."""
        if self.is_noise is False:  # and no word on tuning: more noise would only hide what is wrong
            return [
                f"the residual is not noise: {self._evidence()}. The model lacks something; the estimates are biased "
                "by it and their sigmas too small. `rw-ekf diagnose LOG` looks for what it is."
            ]
        if self.unevenness is not None:
            return [self.unevenness]
        if self.noise_ratio is not None and abs(math.log(self.noise_ratio)) > math.log1p(_NOISE_TOLERANCE):
            word = "larger" if self.noise_ratio > 1.0 else "smaller"
            return [
                f"the innovations are {self.noise_ratio:.2f} times what the configured noise implies ({word}): "
                "`rw-ekf fit LOG --noise` tunes it."
            ]
        return []

    def _evidence(self) -> str:
        assert self.whiteness_p is not None
        assert self.mean_p is not None
        if self._structured:
            return (
                "it depends on speed, current, direction or time in a way that four parameters and noise do not "
                f"(p = {self.structure_p:.1g})"
            )
        if self.mean_p < self.whiteness_p:
            return f"its mean is not zero (p = {self.mean_p:.1g})"
        return (
            f"it is correlated in time ({self.largest_correlation:+.2f} at lag {self.largest_lag}, "
            f"p = {self.whiteness_p:.1g})"
        )


def consistency_of(innovation_rad_s: Float64Array, variance: Float64Array, used: BoolArray) -> Consistency:
    """Test standardised innovations; arrays (n,), `used` marks the accepted ones, others in between are skipped."""
    z = innovation_rad_s[used] / np.sqrt(variance[used])
    z = z[np.isfinite(z)]
    n = z.size
    if n < MIN_SAMPLES:
        return Consistency(n, None, None, None, None, None)
    spread = float(np.std(z))
    if not spread > 0.0:
        return Consistency(n, None, None, None, None, None)
    correlation = autocorrelation(z, min(_LAGS, n // 5))
    worst = int(np.argmax(np.abs(correlation)))
    return Consistency(
        samples=n,
        whiteness_p=ljung_box_p(correlation, n),
        mean_p=math.erfc(abs(float(z.mean())) / spread * math.sqrt(n / 2.0)),
        largest_correlation=float(correlation[worst]),
        largest_lag=worst + 1,
        noise_ratio=math.sqrt(float(np.mean(z**2))),
    )


def autocorrelation(z: Float64Array, lags: int) -> Float64Array:
    """Of z (n,) about its mean at lags 1 to `lags`, (lags,); NaN where all are the same."""
    centred = z - z.mean()
    power = float(centred @ centred) or math.nan
    return np.array([float(centred[:-m] @ centred[m:]) / power for m in range(1, lags + 1)])


def ljung_box_p(correlation: Float64Array, n: int) -> float:
    """P that n values of noise have autocorrelations (lags,) as large as these [Ljung & Box 1978]."""
    lags = np.arange(1, correlation.size + 1)
    return chi_square_tail(n * (n + 2.0) * float(np.sum(correlation**2 / (n - lags))), correlation.size)


def skewed_tail(seen: Float64Array, alone: Float64Array) -> tuple[Float64Array, Float64Array]:
    """P(more than seen (k,)), and than each of the draws (draws, k), of statistics that noise alone has as drawn.

    Tails are those of Pearson's type III, a shifted chi-square, with the draws' mean, spread and skewness: a sum of
    squares has no others. Of draws that are all alike: 0 for what is more than they are, else 1.
    """
    mean, spread = alone.mean(axis=0), alone.std(axis=0)
    least = _ALIKE * np.abs(alone).max(axis=0)
    alike = spread <= least
    spread = np.where(alike, 1.0, spread)
    skewness = np.maximum((((alone - mean) / spread) ** 3).mean(axis=0), _LEAST_SKEWNESS)
    half = 4.0 / skewness**2  # of the chi-square's degrees of freedom

    def tail(values: Float64Array) -> Float64Array:
        spreads = (values - mean) / spread
        smooth = gamma_tail(half, np.maximum(half + np.sqrt(half) * spreads, 0.0))
        return np.where(alike, np.where(values - mean > least, 0.0, 1.0), smooth)

    return tail(seen), tail(alone)
