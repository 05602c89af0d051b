"""How a million samples become what a picture can show: lines keep the extremes of bins, dependences their means."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array

_LINE_BINS = 1500  # about the pixels of a picture's width: two points each
_CORRELATION_SAMPLES = 2**17
_LEAST_IN_BIN = 8.0  # independent samples that make a mean


def thinned_line(x: Float64Array, y: Float64Array, bins: int = _LINE_BINS) -> tuple[Float64Array, Float64Array]:
    """The line's lowest and highest point of each bin, in order; NaN where a whole bin is missing.

    Nothing that a picture could show is lost. Short lines come back as they are.
    """
    n = y.size
    if n <= 4 * bins:
        return x, y
    width = -(-n // bins)
    whole = np.full((-(-n // width), width), np.nan)
    whole.ravel()[:n] = y
    missing = np.isnan(whole)
    low = np.argmin(np.where(missing, np.inf, whole), axis=1)
    high = np.argmax(np.where(missing, -np.inf, whole), axis=1)
    start = np.arange(whole.shape[0]) * width
    index = np.sort(np.column_stack((start + low, start + high)), axis=1).ravel()
    return x[index], y[index]


def broken(y: Float64Array, starts: BoolArray) -> Float64Array:
    """The line with a gap at every start of a new stretch."""
    return np.where(starts, np.nan, y)


def window_sums(y: Float64Array, width: int) -> Float64Array:
    """Sums (n,) of what lies in a window of `width` samples about each, of an even one half a sample before it."""
    sums = np.concatenate(([0.0], np.cumsum(y)))
    first = np.arange(y.size) - width // 2
    return np.asarray(sums[np.minimum(first + width, y.size)] - sums[np.maximum(first, 0)])


def running_means(y: Float64Array, starts: BoolArray, window: int) -> Float64Array:
    """Centred mean of what is there over `window` samples, or a tenth of a stretch; none reaches over its ends."""
    known = np.isfinite(y).astype(np.float64)
    values = np.where(known > 0.0, y, 0.0)
    means = np.full(y.size, np.nan)
    edges = [0, *(int(i) for i in np.flatnonzero(starts) if i > 0), y.size]
    for first, last in pairwise(edges):
        if last <= first:
            continue
        width = max(1, min(window, (last - first) // 10))
        count, total = window_sums(known[first:last], width), window_sums(values[first:last], width)
        means[first:last] = np.where(count > 0.5, total / np.maximum(count, 1.0), np.nan)
    return means


def spans(mask: BoolArray) -> list[tuple[int, int]]:
    """First and last index of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def point_indices(mask: BoolArray, most: int) -> Int64Array:
    """At most `most` indices where mask holds, evenly spread."""
    index = np.flatnonzero(mask)
    return index if index.size <= most else index[np.linspace(0, index.size - 1, most).astype(np.int64)]


@dataclass(eq=False, frozen=True)
class BinnedMeans:
    """Mean of y over bins of x, with its standard error; bins with too little are joined."""

    x: Float64Array  # (m,) mean of x in the bin
    mean: Float64Array
    standard_error: Float64Array
    count: Float64Array

    @property
    def structure(self) -> float:
        """Root mean square of the means, what noise alone would give taken off; 0 where nothing is left."""
        if self.count.size == 0:
            return float("nan")
        excess = np.average(self.mean**2 - self.standard_error**2, weights=self.count)
        return float(np.sqrt(max(0.0, float(excess))))


def binned_means(
    x: Float64Array,
    y: Float64Array,
    mask: BoolArray,
    edges: Float64Array,
    correlation: float,
    lever: Float64Array | None = None,
) -> BinnedMeans:
    """Means of y over the bins given by (m + 1,) edges, neighbours joined until there is enough for a mean.

    correlation: samples that count as one. lever (n,), about one in size: y per unit of it is found, by least squares;
    None: ones.
    """
    usable = mask & (x >= edges[0]) & (x <= edges[-1]) & np.isfinite(y)
    if lever is not None:
        usable &= lever != 0.0
    x, y, w = x[usable], y[usable], np.ones(np.count_nonzero(usable)) if lever is None else lever[usable]
    index = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, edges.size - 2)
    terms = (np.ones_like(w), w * w, w * w * x, w * y, y * y)
    sums = np.array([np.bincount(index, values, edges.size - 1) for values in terms])
    joined: list[Float64Array] = []
    gathered = np.zeros(len(terms))
    for column in sums.T:
        gathered = gathered + column
        if gathered[1] >= _LEAST_IN_BIN * correlation:
            joined.append(gathered)
            gathered = np.zeros(len(terms))
    if joined:
        joined[-1] = joined[-1] + gathered  # what is left at the end is too little to stand alone
    count, *totals = np.array(joined).T if joined else np.zeros((len(terms), 0))
    mean_x, mean, square = (total / totals[0] for total in totals[1:])
    variance = np.maximum(square - mean**2, 0.0)
    return BinnedMeans(mean_x, mean, np.sqrt(variance * correlation / count), count)


def correlation_samples(residual: Float64Array, window: int) -> float:
    """Samples of a smoothed residual that count as one: the sum of its autocorrelation, structure taken off.

    window: samples of the running mean that stands for structure; the sum ends where the correlation has died down.
    """
    values = residual[:_CORRELATION_SAMPLES]
    values = np.where(np.isfinite(values), values, 0.0)
    window = min(window, values.size)
    if window < 3:
        return 1.0
    values = values - window_sums(values, window) / window_sums(np.ones(values.size), window)
    power = np.abs(np.fft.rfft(values, 2 * values.size)) ** 2
    correlation = np.fft.irfft(power)[: max(2, window // 2)]
    if not correlation[0] > 0.0:
        return 1.0
    correlation = correlation / correlation[0]
    died = np.flatnonzero(correlation < 0.05)
    end = int(died[0]) if died.size else correlation.size
    return float(1.0 + 2.0 * correlation[1:end].sum())
