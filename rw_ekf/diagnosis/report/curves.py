"""Curves with their errors, each in a panel of its own: of a cause that is named, or of what no effect explains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.report.canvas import AFTER, BEFORE, GREY, INK, legend, new_figure, plain, png
from rw_ekf.diagnosis.report.drawn_time import Timeline
from rw_ekf.drawing import picture

_ALONG = {
    "speed": "|speed|",
    "low speed": "|speed|",
    "current": "|current|",
    "time": "time since the log's start",
    "temperature": "temperature",
    "angle": "angle within a turn",
}
_KINDS = {
    "drag": "additional drag",
    "torque": "torque, whichever way the wheel turns",
    "torque along the current": "torque along the current",
    "motor gain": "change of the motor gain",
}


@dataclass(eq=False, frozen=True)
class Curve:
    """Points (m,) with their error bars, and the law (k,) through them where one was found."""

    title: str
    x_label: str
    y_label: str
    x: Float64Array
    y: Float64Array
    error: Float64Array  # two sigma
    law_x: Float64Array | None = None
    law_y: Float64Array | None = None
    law_error: Float64Array | None = None  # (k,) two sigma, of a law that has no formula


def shape_curves(shapes: Sequence[Mapping[str, Any]], time: Timeline) -> list[Curve]:
    """The curves of the document, in time's unit where they are over time."""
    curves = []
    for shape in shapes:
        at, value, std = (np.asarray(shape[key], dtype=np.float64) for key in ("at", "value", "std"))
        along, unit = _ALONG[shape["dependence"]], str(shape["at_unit"]).replace("degC", "°C")
        if shape["dependence"] == "time":
            at, unit = (at - time.start_s) / time.unit_s, time.unit
        y_label = f"{_KINDS[shape['kind']]} [{str(shape['unit']).replace('^2', '²')}]"
        curves.append(Curve(shape["dependence"], f"{along} [{unit}]", y_label, at, value, 2.0 * std))
    return curves


@picture
def curves_picture(curves: Sequence[Curve], *, left_over: bool = False) -> bytes | None:
    """A panel for each curve as a PNG; None without any. left_over: of what is small beside what was explained."""
    if not curves:
        return None
    from matplotlib.ticker import MaxNLocator

    columns = 1 if len(curves) == 1 else 2
    rows = -(-len(curves) // columns)
    figure = new_figure(4.4 if rows == 1 else 0.3 + 2.6 * rows)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis in axes[len(curves) :]:
        axis.remove()
    for axis, curve in zip(axes, curves, strict=False):
        plain(axis)
        axis.axhline(0.0, color=GREY, lw=0.8, zorder=1)
        colour = AFTER if left_over else BEFORE
        style = "o" if curve.law_x is not None else "o-"
        points = axis.errorbar(curve.x, curve.y, curve.error, fmt=style, color=colour, ms=3.6, lw=1.4, elinewidth=1.0)
        entries = [(points, "measured: mean ± 2 standard errors")]
        if curve.law_x is not None:
            (law,) = axis.plot(curve.law_x, curve.law_y, color=AFTER, lw=2.2, zorder=3)
            entries.append((law, "the law that was added"))
            if curve.law_error is not None:
                assert curve.law_y is not None
                edges = (curve.law_y - curve.law_error, curve.law_y + curve.law_error)
                axis.fill_between(curve.law_x, *edges, color=AFTER, alpha=0.25, lw=0.0, zorder=2)
        else:
            entries = [(points, "best fit ± 2 sigma")]
        axis.margins(x=0.02)
        axis.xaxis.set_major_locator(MaxNLocator(6 // columns + 1))
        axis.set_xlabel(curve.x_label, fontsize=9)
        axis.set_ylabel(curve.y_label, fontsize=9)
        axis.set_title(curve.title, fontsize=9.5, loc="left", color=INK)
    legend(figure, entries)
    return png(figure)
