"""The picture of speed: measured and predicted, and what the prediction misses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.diagnosis.report.binning import broken, running_means, thinned_line
from rw_ekf.diagnosis.report.canvas import FRAME, GREY, ground, legend, new_figure, plain, png, shade
from rw_ekf.diagnosis.report.quantities import models_of
from rw_ekf.diagnosis.report.timeline import Timeline, timeline
from rw_ekf.diagnosis.report.words import Units
from rw_ekf.drawing import picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rw_ekf.diagnosis.result import Diagnosis

_RUNNING_MEANS = 300  # so many fit into a record: what is beneath the noise of the readings
_STRAYS = 99.7  # percentile of the errors that are shown


@dataclass(frozen=True)
class Prediction:
    """A model's free run (n,) in the picture's unit, and how it is drawn."""

    label: str
    colour: str
    style: Any
    speed: Float64Array


@dataclass(frozen=True)
class SpeedCourse:
    """What the picture shows; arrays (n,)."""

    time: Timeline
    measured: Float64Array
    unit: str
    predictions: Sequence[Prediction]
    drive: Float64Array
    drive_label: str
    segment_starts: BoolArray
    stretch_starts: BoolArray  # where a free run begins anew: it jumps back to the measured speed there
    heldout: BoolArray


def speed_course(diagnosis: Diagnosis, units: Units) -> SpeedCourse:
    """The arrays of the picture, in the report's units."""
    log = diagnosis.log
    segments = np.diff(log.segment, prepend=log.segment[:1]) != 0
    held = diagnosis.heldout.astype(np.int8)
    models = models_of(diagnosis)
    return SpeedCourse(
        timeline(np.asarray(log.time_s, dtype=np.float64)),
        log.speed_rad_s / units.speed_scale,
        units.speed,
        [
            Prediction(
                f"model{f' {model.name}' if len(models) > 1 else ''}, free run", model.colour, model.dashes,
                model.trace.free_run_rad_s / units.speed_scale,
            )
            for model in models
        ],  # fmt: skip
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
    entries += [(_draw_speed(upper, x, one, course), one.label) for one in course.predictions]
    if course.predictions:
        largest = max(_draw_error(lower, x, one, course) for one in course.predictions)
        lower.axhline(0.0, color=GREY, lw=0.8, zorder=1)
        if largest > 0.0:
            lower.set_ylim(-1.15 * largest, 1.15 * largest)
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


def _draw_speed(axis: Any, x: Float64Array, one: Prediction, course: SpeedCourse) -> Any:
    drawn = thinned_line(x, broken(one.speed, course.stretch_starts))
    return axis.plot(*drawn, color=one.colour, lw=1.2, ls=one.style)[0]


def _draw_error(axis: Any, x: Float64Array, one: Prediction, course: SpeedCourse) -> float:
    """The error with its running mean; returns how far it reaches, strays left out."""
    error = broken(course.measured - one.speed, course.stretch_starts)
    axis.plot(*thinned_line(x, error), color=one.colour, lw=0.6, alpha=0.35)
    smooth = running_means(error, course.stretch_starts, 1 + error.size // _RUNNING_MEANS)
    axis.plot(*thinned_line(x, broken(smooth, course.stretch_starts)), color=one.colour, lw=1.8)
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
