"""The pictures of a contest: who keeps the attitude, at a glance, and the courses of the attitude themselves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rw_ekf.attitude_bench.contest import Contest, Entry
from rw_ekf.attitude_bench.contest_result import BASELINE, Row
from rw_ekf.attitude_bench.metrics import RECOVERED_DEG
from rw_ekf.diagnosis.report.canvas import AFTER, BEFORE, GREY, INK, new_figure, plain, png
from rw_ekf.drawing import picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NOISE_COLOURS = (AFTER, BEFORE, "#0b6e4f", GREY)
_WIDTH_IN = 9.8
_SHOWN_BEFORE_S, _SHOWN_AFTER_S = 15.0, 60.0
_NAMED = {BASELINE: BEFORE, "dmc": "#8a5fb0", "predictive_crossing": AFTER, "dmc_deterministic": "#b08a00"}


def peaks_picture(rows: Sequence[Row], noises_rpm: Sequence[float]) -> bytes:
    """`peaks_figure` as a PNG."""
    return picture(png)(peaks_figure(rows, noises_rpm))


@picture
def peaks_figure(rows: Sequence[Row], noises_rpm: Sequence[float]) -> Figure:
    """Peak error of each scheme on a logarithmic scale, best first; a line extends to the worst seed."""
    from matplotlib.ticker import LogFormatter

    last = [row for row in rows if row.noise_rpm == noises_rpm[-1]]
    order = [row.scheme for row in sorted(last, key=lambda row: (math.isnan(row.peak_deg), row.peak_deg))]
    figure = new_figure(1.2 + 0.27 * len(order), _WIDTH_IN)
    axis = figure.subplots()
    for i, noise_rpm in enumerate(noises_rpm):
        colour = _NOISE_COLOURS[i % len(_NOISE_COLOURS)]
        here = [row for row in rows if row.noise_rpm == noise_rpm and math.isfinite(row.peak_deg)]
        shift = 0.22 * (i - 0.5 * (len(noises_rpm) - 1))
        places = [order.index(row.scheme) + shift for row in here]
        axis.hlines(
            places, [row.peak_deg for row in here], [row.worst_deg for row in here], color=colour, lw=1.6, alpha=0.5
        )
        axis.plot([row.peak_deg for row in here], places, "o", ms=5.5, color=colour, label=f"{noise_rpm:g} rpm")
    axis.axvline(RECOVERED_DEG, color=GREY, lw=0.9, ls=(0, (4, 3)))
    axis.set_xscale("log")
    axis.set_yticks(range(len(order)), order)
    axis.set_ylim(len(order) - 0.5, -0.5)
    axis.set_xlabel("peak attitude error after the reversal [deg]")
    axis.legend(title="speed noise", frameon=False, loc="upper right", fontsize=8.5, title_fontsize=8.5)
    axis.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.xaxis.set_minor_formatter(LogFormatter())
    plain(axis)
    return figure


@picture
def courses_picture(contest: Contest, noise_rpm: float) -> bytes | None:
    """Attitude error around the reversal at one noise, first seed: whole, and near zero. PNG; None: nothing to show."""
    courses = {
        entry.scheme: run
        for entry, run in contest.courses.items()
        if entry == Entry(entry.scheme, noise_rpm, 1) and run.reversal_s is not None
    }
    if not courses:
        return None
    figure = new_figure(4.6, _WIDTH_IN)
    whole, near = figure.subplots(1, 2)
    for scheme, run in sorted(courses.items(), key=lambda item: item[0] in _NAMED):
        assert run.reversal_s is not None
        time_s = run.time_s - run.reversal_s
        shown = (time_s >= -_SHOWN_BEFORE_S) & (time_s <= _SHOWN_AFTER_S)
        error = np.degrees(run.attitude_rad[shown])
        colour, named = _NAMED.get(scheme, "#c9ced5"), scheme in _NAMED
        for axis in (whole, near):
            axis.plot(time_s[shown], error, color=colour, lw=1.9 if named else 0.8, label=scheme if named else None)
    near.set_ylim(-0.3, 0.3)
    for axis, title in ((whole, "all of it"), (near, "near zero")):
        axis.set_xlabel("time since the reversal [s]")
        axis.set_title(title, fontsize=9.5, loc="left", color=INK)
        axis.axvline(0.0, color=GREY, lw=0.8)
        axis.axhspan(-RECOVERED_DEG, RECOVERED_DEG, color="#eef1f5", zorder=0)
        plain(axis)
    whole.set_ylabel("attitude error [deg]")
    whole.legend(frameon=False, fontsize=8.5, loc="best")
    return png(figure)
