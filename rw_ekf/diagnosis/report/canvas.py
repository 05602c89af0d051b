"""What the pictures of a report share: colours, axes, PNG bytes, and how a million samples are thinned to be drawn.

Colours are told apart by a colour-blind eye; lines keep the extremes of bins, dependences their means.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from rw_ekf.diagnosis.result import Diagnosis
    from rw_ekf.logs.wheel_log import WheelLog

# Okabe and Ito's vermilion and blue: far apart for every kind of colour vision, and in grey.
BEFORE, AFTER = "#c8500a", "#0067b1"
INK, GREY, PALE, FRAME = "#1d2126", "#6b727b", "#e9ecf0", "#aab0b8"
WIDTH_IN = 9.8
_DPI = 150
_COMPRESSION = 4  # three quarters of the time of the usual 6, 3 % more bytes


def new_figure(height_in: float, *, measured: bool = True) -> Figure:
    """A figure of the report's width, outside pyplot and its global state.

    measured: axes leave the room that their labels turn out to need; else see `with_margins`.
    """
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH_IN, height_in), facecolor="white", layout="constrained" if measured else None)


class Margins(NamedTuple):
    """Room around axes, for labels, ticks and a legend above, and between their rows [inches]."""

    above: float = 0.42
    below: float = 0.5
    left: float = 0.85
    right: float = 0.22
    rows: float = 0.0


def with_margins(figure: Figure, margins: Margins, rows: int = 1) -> None:
    """Place the axes where the margins leave room: to measure every label for it takes a third of the drawing."""
    width, height = figure.get_figwidth(), figure.get_figheight()
    each = (height - margins.above - margins.below - (rows - 1) * margins.rows) / rows
    figure.subplots_adjust(
        left=margins.left / width,
        right=1.0 - margins.right / width,
        bottom=margins.below / height,
        top=1.0 - margins.above / height,
        hspace=margins.rows / each,
    )


def plain(axis: Any) -> None:
    """Only the frame's lower left, thin grid, grey ticks."""
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
    for side in ("bottom", "left"):
        axis.spines[side].set_color(FRAME)
    axis.tick_params(labelsize=8.5, color=FRAME, labelcolor=INK)
    axis.grid(visible=True, color=PALE, lw=0.8)
    axis.set_axisbelow(True)


def colour_of_first(diagnosis: Diagnosis) -> str:
    """Colour of the model before: red, unless it stands alone and is all that is needed."""
    kind = (diagnosis.document().get("verdict") or {}).get("kind")
    return AFTER if diagnosis.after is None and kind == "adequate" else BEFORE


def shade(axis: Any, time: TimeAxis, heldout: NDArray[Any]) -> None:
    """Grey ground where the record was held out."""
    # One collection: a long record has thousands of stretches.
    ranges = []
    for first, last in spans(heldout):
        start, end = time.values[first], time.values[min(last + 1, time.values.size - 1)]
        ranges.append((start, end - start))
    if ranges:
        axis.broken_barh(
            ranges, (0.0, 1.0), transform=axis.get_xaxis_transform(), color="#eef0f3", lw=0, zorder=0, clip_on=True
        )


def legend(figure: Figure, entries: list[tuple[Any, str]]) -> None:
    """One line above everything."""
    handles, labels = [handle for handle, _ in entries], [label for _, label in entries]
    figure.legend(
        handles, labels, loc="upper left", ncols=len(entries), frameon=False, fontsize=9.5, labelcolor=INK,
        handlelength=1.8, columnspacing=1.8, borderaxespad=0.2,
    )  # fmt: skip


def ground() -> Any:
    """A legend's handle for the shading of held-out stretches."""
    from matplotlib.patches import Patch

    return Patch(facecolor="#e3e6ea", edgecolor="none")


def png(figure: Figure) -> bytes:
    """The figure as a PNG. Drawn once: `savefig` draws everything twice, the first time to lay it out."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    figure.set_dpi(_DPI)
    buffer = io.BytesIO()
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    opaque = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")  # a white ground needs no fourth channel
    opaque.save(buffer, "png", compress_level=_COMPRESSION, dpi=(_DPI, _DPI))
    return buffer.getvalue()


_LINE_BINS = 1500  # about the pixels of a picture's width: two points each
_CORRELATION_SAMPLES = 2**17
_LEAST_IN_BIN = 8.0  # independent samples that make a mean


_CLOCK_S = 1.0e5  # beyond it a clock's time, not a run's: too long for ticks


@dataclass(eq=False, frozen=True)
class TimeAxis:
    """Time as it is drawn: since the log's start, increasing throughout, in seconds or hours."""

    values: Float64Array  # (n,) in `unit`
    unit: str
    label: str
    start_s: float = 0.0  # the log's own time where it starts
    continuous: bool = True  # it never restarts: the log's own time is `start_s` more throughout

    @property
    def long_label(self) -> str:
        """The label, with the log's own time at its start where that is not zero."""
        if self.start_s == 0.0:
            return self.label
        return (
            f"{self.label}, which is at {self.start_s:.{1 if abs(self.start_s) < _CLOCK_S else 0}f} s of its own time"
        )

    @property
    def unit_s(self) -> float:
        """Seconds of one unit."""
        return 3600.0 if self.unit == "h" else 1.0

    def show_own(self, axis: Any) -> bool:
        """The log's own time stamps above an axis, where they are another time and fit there; whether they do."""
        if self.start_s == 0.0 or not self.continuous or abs(self.start_s) > _CLOCK_S:
            return False
        start = self.start_s / self.unit_s
        above = axis.secondary_xaxis("top", functions=(lambda t: t + start, lambda t: t - start))
        above.set_xlabel(f"the log's own time [{self.unit}]", fontsize=8.5, color=GREY)
        above.tick_params(labelsize=8, color=FRAME, labelcolor=GREY)
        above.spines["top"].set_visible(False)
        return True


def time_axis(log: WheelLog) -> TimeAxis:
    """Time since the log's start; a segment whose time restarts follows the one before."""
    time_s = np.asarray(log.time_s, dtype=np.float64)
    if time_s.size == 0:
        return TimeAxis(time_s, "s", "time [s]")
    step_s = np.diff(time_s)
    forward = step_s[step_s > 0.0]
    usual_s = float(np.median(forward)) if forward.size else 1.0
    shift = np.cumsum(np.where(step_s > 0.0, 0.0, usual_s - step_s))
    start_s = float(time_s[0])
    drawn = time_s - start_s
    drawn[1:] += shift
    unit, unit_s = ("h", 3600.0) if drawn[-1] > 3.0 * 3600.0 else ("s", 1.0)
    since = " since the log's start" if start_s != 0.0 else ""
    return TimeAxis(drawn / unit_s, unit, f"time{since} [{unit}]", start_s, continuous=bool(np.all(shift == 0.0)))


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
    if index.size <= most:
        return index
    return index[np.linspace(0, index.size - 1, most).astype(np.int64)]


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
    x: Float64Array, y: Float64Array, mask: BoolArray, edges: Float64Array, correlation: float
) -> BinnedMeans:
    """Means of y over the bins given by (m + 1,) edges, neighbours joined until there is enough for a mean.

    correlation: samples that count as one.
    """
    usable = mask & (x >= edges[0]) & (x <= edges[-1]) & np.isfinite(y)
    x, y = x[usable], y[usable]
    index = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, edges.size - 2)
    sums = np.array([np.bincount(index, values, edges.size - 1) for values in (np.ones_like(x), x, y, y * y)])
    joined: list[Float64Array] = []
    gathered = np.zeros(4)
    for column in sums.T:
        gathered = gathered + column
        if gathered[0] >= _LEAST_IN_BIN * correlation:
            joined.append(gathered)
            gathered = np.zeros(4)
    if joined:
        joined[-1] = joined[-1] + gathered  # what is left at the end is too little to stand alone
    count, *totals = np.array(joined).T if joined else np.zeros((4, 0))
    mean_x, mean, square = (total / count for total in totals)
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
