"""Pictures of a diagnosis: speed measured and predicted, and the evidence for every candidate."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.diagnosis.report.canvas import (
    AFTER,
    GREY,
    INK,
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
from rw_ekf.diagnosis.report.words import (
    Units,
    gain_text,
    p_value_text,
    probability_text,
    ranked,
    untestable_reasons,
)
from rw_ekf.diagnosis.standing import Standing, standing_of

if TYPE_CHECKING:
    from rw_ekf.arrays import BoolArray, Float64Array
    from rw_ekf.diagnosis.result import Diagnosis
    from rw_ekf.logs.wheel_log import WheelLog

_BARS: dict[Standing, str] = {"added": AFTER, "related": "#7fb2dc", "rejected": "#b4bac2", "untestable": "#b4bac2"}
_RUNNING_MEANS = 300  # so many fit into a record: what is beneath the noise of the readings
_FLOOR = 1.0  # statistics below are drawn as a stub: the scale is logarithmic


def speed_picture(diagnosis: Diagnosis, units: Units) -> bytes:
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
    return png(figure)


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


def evidence_picture(document: Mapping[str, Any]) -> bytes | None:
    """A bar for every candidate that was tested, those that were not below; None without candidates."""
    candidates = list(document.get("candidates") or ())
    tested, reasons = ranked(candidates), untestable_reasons(candidates)
    rows = len(tested) + sum(len(effects) for effects in reasons.values())
    if rows == 0:
        return None
    figure = new_figure(0.95 + 0.26 * rows, measured=False)
    top, bottom = 0.36 / figure.get_figheight(), 0.5 / figure.get_figheight()
    axis = figure.add_axes((0.185, bottom, 0.27, 1.0 - top - bottom))
    statistics = [_drawn(candidate.get("statistic")) for candidate in tested]
    axis.set_xscale("log")
    axis.set_xlim(_FLOOR, 1.6 * max([20.0, *statistics]))
    axis.set_ylim(rows - 0.4, -0.6)
    colours = [_BARS[standing_of(candidate)] for candidate in tested]
    axis.barh(range(len(tested)), [s - _FLOOR for s in statistics], left=_FLOOR, height=0.66, color=colours)
    plain(axis)
    axis.minorticks_off()
    axis.grid(visible=False, axis="y")
    axis.spines["left"].set_visible(False)
    axis.set_yticks([])
    axis.set_xlabel("evidence: twice the gain in log-likelihood", fontsize=9)
    for row, candidate in enumerate(tested):
        _write_row(axis, row, candidate)
    row = len(tested)
    for reason, effects in reasons.items():
        for effect in effects:
            _write(axis, -0.02, row, effect, ha="right", color=GREY)
            _write(axis, 0.02, row, _short(f"not testable: {reason}", 90), ha="left", color=GREY)
            row += 1
    above = 1.0 + 0.09 / figure.get_figheight()
    for x, label, ha in _COLUMNS:
        axis.text(x, above, label, transform=axis.transAxes, ha=ha, fontsize=8.5, color=GREY)
    return png(figure)


# x in widths of the bars, heading, alignment
_COLUMNS = (
    (1.17, "probability", "right"),
    (1.47, "p-value", "right"),
    (1.86, "held-out error", "right"),
    (1.93, "decision", "left"),
)


def _write_row(axis: Any, row: int, candidate: Mapping[str, Any]) -> None:
    added = standing_of(candidate) == "added"
    style = {"color": INK if added else "#3d444c", "weight": "bold" if added else "normal"}
    _write(axis, -0.02, row, str(candidate.get("effect")), ha="right", **style)
    texts = (
        probability_text(candidate.get("posterior")),
        p_value_text(candidate.get("p_value")),
        gain_text(candidate),
        _short(str(candidate.get("decision") or ""), 42),
    )
    for (x, _, ha), text in zip(_COLUMNS, texts, strict=True):
        _write(axis, x, row, text, ha=ha, **style)
    threshold = candidate.get("threshold")
    if isinstance(threshold, int | float) and threshold > _FLOOR:
        axis.plot([threshold, threshold], [row - 0.42, row + 0.42], color=INK, lw=1.4)


def _write(axis: Any, x: float, row: int, text: str, *, ha: str, **style: Any) -> None:
    """Text beside the bars: x in widths of the axis, y in rows; words of a document are no mathematics."""
    place = axis.get_yaxis_transform()
    axis.text(x, row, text, transform=place, ha=ha, va="center", fontsize=8.5, parse_math=False, **style)


def _drawn(statistic: object) -> float:
    """A bar's end: a stub for what is missing or hardly above nothing."""
    value = float(statistic) if isinstance(statistic, int | float) else math.nan
    return max(value, 1.04 * _FLOOR) if math.isfinite(value) else 1.04 * _FLOOR


def _short(text: str, most: int) -> str:
    return text if len(text) <= most else text[: most - 1].rstrip() + "…"
