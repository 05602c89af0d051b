"""The picture of speed: measured and predicted, and what the prediction misses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.diagnosis.report.binning import broken, running_means, thinned_line
from rw_ekf.diagnosis.report.canvas import FRAME, GREY, ground, legend, new_figure, plain, png, shade
from rw_ekf.diagnosis.report.drawn_time import Timeline, timeline
from rw_ekf.diagnosis.report.quantities import DrawnModel, models_of
from rw_ekf.diagnosis.report.words import Units
from rw_ekf.drawing import picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rw_ekf.diagnosis.outcome import Outcome

_RUNNING_MEANS = 300  # so many fit into a record: what is beneath the noise of the readings
_STRAYS = 99.7  # percentile of the errors that are shown


@dataclass(eq=False, frozen=True)
class SpeedCourse:
    """What the picture shows; arrays (n,)."""

    time: Timeline
    measured: Float64Array
    unit: str
    models: Sequence[DrawnModel]
    predicted: Sequence[Float64Array]  # of each model its free run
    drive: Float64Array
    drive_label: str
    segment_starts: BoolArray
    stretch_starts: BoolArray  # where a free run begins anew: it jumps back to the measured speed there
    heldout: BoolArray


def speed_course(diagnosis: Outcome, units: Units) -> SpeedCourse:
    """The arrays of the picture, in the report's units."""
    log = diagnosis.log
    segments = np.diff(log.segment, prepend=log.segment[:1]) != 0
    held = diagnosis.heldout.astype(np.int8)
    models = models_of(diagnosis)
    return SpeedCourse(
        timeline(np.asarray(log.time_s, dtype=np.float64)),
        log.speed_rad_s / units.speed_scale,
        units.speed,
        models,
        [model.trace.free_run_rad_s / units.speed_scale for model in models],
        log.current_A / units.current_scale,
        f"{units.drive} [{units.current}]",
        segments,
        segments | (np.diff(held, prepend=held[:1]) != 0),
        diagnosis.heldout,
    )


@picture
def speed_picture(course: SpeedCourse) -> bytes:
    """`speed_figure` as a PNG."""
    return png(speed_figure(course))


@picture
def speed_figure(course: SpeedCourse) -> Figure:
    """Speed measured and simulated, and what the simulation misses it by; with no model, speed and drive."""
    from matplotlib.ticker import MaxNLocator

    figure, x = new_figure(4.4), course.time.values
    upper, lower = figure.subplots(2, 1, sharex=True)
    measured = thinned_line(x, broken(course.measured, course.segment_starts))
    (line,) = upper.plot(*measured, color=FRAME, lw=4.5, alpha=0.75, solid_capstyle="butt")
    entries: list[tuple[Any, str]] = [(line, "measured")]
    reach = [0.0]
    for model, predicted in zip(course.models, course.predicted, strict=True):
        (line,) = upper.plot(
            *thinned_line(x, broken(predicted, course.stretch_starts)), color=model.colour, lw=1.2, ls=model.dashes
        )
        entries.append((line, f"model{f' {model.name}' if len(course.models) > 1 else ''}, free run"))
        reach.append(_draw_error(lower, x, course.measured - predicted, course.stretch_starts, model.colour))
    if course.models:
        lower.axhline(0.0, color=GREY, lw=0.8, zorder=1)
        if max(reach) > 0.0:
            lower.set_ylim(-1.15 * max(reach), 1.15 * max(reach))
        lower.set_ylabel(f"measured − free run [{course.unit}]", fontsize=9)
    else:
        lower.plot(*thinned_line(x, course.drive), color=GREY, lw=1.0, drawstyle="steps-post")
        lower.set_ylabel(course.drive_label, fontsize=9)
    upper.set_ylabel(f"speed [{course.unit}]", fontsize=9)
    lower.set_xlabel(course.time.long_label, fontsize=9)
    if course.heldout.any():
        entries.append((ground(), "held out"))
    for axis in (upper, lower):
        plain(axis)
        shade(axis, x, course.heldout)
        axis.margins(x=0.0)
        axis.yaxis.set_major_locator(MaxNLocator(5))
    _show_own_time(upper, course.time)
    legend(figure, entries)
    figure.align_ylabels([upper, lower])
    return figure


def _draw_error(axis: Any, x: Float64Array, error: Float64Array, starts: BoolArray, colour: str) -> float:
    """The error with its running mean; returns how far it reaches, strays left out."""
    error = broken(error, starts)
    axis.plot(*thinned_line(x, error), color=colour, lw=0.6, alpha=0.35)
    smooth = running_means(error, starts, 1 + error.size // _RUNNING_MEANS)
    axis.plot(*thinned_line(x, broken(smooth, starts)), color=colour, lw=1.8)
    return float(np.nanpercentile(np.abs(error), _STRAYS)) if np.isfinite(error).any() else 0.0


def _show_own_time(axis: Any, time: Timeline) -> None:
    """The log's own time stamps above an axis, where they are another time."""
    start = time.own
    if start is None:
        return
    above = axis.secondary_xaxis("top", functions=(lambda t: t + start, lambda t: t - start))
    above.set_xlabel(f"the log's own time [{time.unit}]", fontsize=8.5, color=GREY)
    above.tick_params(labelsize=8, color=FRAME, labelcolor=GREY)
    above.spines["top"].set_visible(False)
