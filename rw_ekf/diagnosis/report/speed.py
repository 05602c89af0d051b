"""The picture of speed: measured and predicted, and what the prediction misses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.diagnosis.report.canvas import (
    AFTER,
    GREY,
    Margins,
    broken,
    colour_of_first,
    ground,
    legend,
    new_figure,
    plain,
    png,
    running_means,
    shade,
    thinned_line,
    time_axis,
    with_margins,
)
from rw_ekf.diagnosis.report.words import Units
from rw_ekf.drawing import picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rw_ekf.arrays import BoolArray, Float64Array
    from rw_ekf.diagnosis.result import Diagnosis
    from rw_ekf.logs.wheel_log import WheelLog

_RUNNING_MEANS = 300  # so many fit into a record: what is beneath the noise of the readings


@picture
def speed_picture(diagnosis: Diagnosis, units: Units) -> bytes:
    """`speed_figure` as a PNG."""
    return png(speed_figure(diagnosis, units))


@picture
def speed_figure(diagnosis: Diagnosis, units: Units) -> Figure:
    """Speed measured and simulated, and what the simulation misses it by; with no model, speed and current."""
    from matplotlib.ticker import MaxNLocator

    log, time = diagnosis.log, time_axis(diagnosis.log)
    figure = new_figure(4.9, measured=False)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[1.0, 1.0])
    measured = log.speed_rad_s / units.speed_scale
    starts = _stretch_starts(log, diagnosis.heldout)
    (line,) = upper.plot(
        *thinned_line(time.values, broken(measured, _segment_starts(log))),
        color="#9aa1a9",
        lw=2.6,
        solid_capstyle="butt",
    )
    entries: list[tuple[Any, str]] = [(line, "measured")]
    first = colour_of_first(diagnosis)
    traces = [("before", diagnosis.before, first, (0, (4, 1.5))), ("after", diagnosis.after, AFTER, "-")]
    largest = [0.0]
    for label, trace, colour, style in traces:
        if trace is None:
            continue
        predicted = broken(trace.free_run_rad_s / units.speed_scale, starts)
        (line,) = upper.plot(*thinned_line(time.values, predicted), color=colour, lw=1.1, ls=style)
        name = f"model {label}" if diagnosis.after is not None else "model"
        entries.append((line, f"{name}, free run"))
        error = measured - predicted
        lower.plot(*thinned_line(time.values, error), color=colour, lw=0.6, alpha=0.4)
        smooth = broken(running_means(error, starts, 1 + error.size // _RUNNING_MEANS), starts)
        lower.plot(*thinned_line(time.values, smooth), color=colour, lw=2.0)
        if np.isfinite(error).any():
            largest.append(float(np.nanpercentile(np.abs(error), 99.7)))
    if diagnosis.before is None:
        _draw_current(lower, time.values, log, units)
    else:
        lower.axhline(0.0, color=GREY, lw=0.8, zorder=1)
        if max(largest) > 0.0:
            lower.set_ylim(-1.15 * max(largest), 1.15 * max(largest))
        lower.set_ylabel(f"measured − free run [{units.speed}]", fontsize=9.5)
    upper.set_ylabel(f"speed [{units.speed}]", fontsize=9.5)
    lower.set_xlabel(time.long_label, fontsize=9.5)
    if diagnosis.heldout.any():
        entries.append((ground(), "held out: no parameter of the figures was fitted to it"))
    for axis in (upper, lower):
        plain(axis)
        shade(axis, time, diagnosis.heldout)
        axis.margins(x=0.0)
        axis.yaxis.set_major_locator(MaxNLocator(5))
    own = time.show_own(upper)
    legend(figure, entries)
    figure.align_ylabels([upper, lower])
    with_margins(figure, Margins(above=0.86 if own else 0.42, rows=0.16), rows=2)
    return figure


def _draw_current(axis: Any, time: Float64Array, log: WheelLog, units: Units) -> None:
    axis.plot(*thinned_line(time, log.current_A / units.current_scale), color=GREY, lw=1.0, drawstyle="steps-post")
    axis.set_ylabel(f"{'current' if units.wheel else 'drive'} [{units.current}]", fontsize=9.5)


def _segment_starts(log: WheelLog) -> BoolArray:
    starts = np.zeros(len(log), dtype=bool)
    starts[1:] = np.diff(log.segment) != 0
    return starts


def _stretch_starts(log: WheelLog, heldout: BoolArray) -> BoolArray:
    """Where a free run begins anew: it jumps back to the measured speed there."""
    starts = _segment_starts(log)
    starts[1:] |= np.diff(heldout.astype(np.int8)) != 0
    return starts
