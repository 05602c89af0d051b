"""Pictures of a run: speed, innovation with its band, the parameters converging with theirs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.console import printable
from rw_ekf.drawing import picture
from rw_ekf.logs.log_picture import BLUE, GREY, RED, draw_speed, legend
from rw_ekf.model.state import PARAMETER_NAMES, STATE_UNITS
from rw_ekf.units import RAD_S_PER_RPM

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rw_ekf.filter.belief import Belief
    from rw_ekf.fit_summary import FitSummary
    from rw_ekf.logs.wheel_log import WheelLog

_TITLES = {
    "motor_gain": "motor gain",
    "viscous": "viscous friction",
    "coulomb": "Coulomb friction",
    "static": "break-away friction",
}


@picture
def run_figure(
    log: WheelLog,
    columns: Mapping[str, Any],
    *,
    truth: Mapping[str, float] | None = None,
    hindsight: Belief | None = None,
    title: str = "",
    wheel_units: bool = True,
) -> Figure:
    """Draw one replayed log. `columns` are those of `replay --out`; truth: parameters, drawn dashed.

    hindsight: what is believed of the whole log, drawn at its end where the rows are the filter's as it went.
    wheel_units: rpm and mA; otherwise as the log has them, for a plant that is not a wheel.
    """
    from matplotlib.figure import Figure

    time_s = np.asarray(columns["time_s"], dtype=np.float64)
    time_s = time_s - (time_s[0] if time_s.size else 0.0)
    figure = Figure(figsize=(10, 13))
    axes = figure.subplots(6, 1, sharex=True, height_ratios=[1.5, 1.2, 1, 1, 1, 1])
    estimate = np.asarray(columns["speed_rad_s"]) if "speed_rad_s" in columns else None
    draw_speed(axes[0], time_s, log.speed_rad_s, log.current_A, estimate, wheel_units=wheel_units)
    _draw_innovation(axes[1], time_s, columns, wheel_units=wheel_units)
    for axis, name in zip(axes[2:], PARAMETER_NAMES, strict=True):
        _draw_parameter(axis, time_s, columns, name, None if truth is None else truth.get(name))
        if hindsight is not None:
            _draw_hindsight(axis, time_s, hindsight, name)
    axes[-1].set_xlabel("time [s]")
    for axis in axes:
        axis.grid(visible=True, alpha=0.25)
        axis.margins(x=0.01)
    figure.suptitle(printable(title or log.name), fontsize=12)
    figure.align_ylabels(axes)
    figure.tight_layout(rect=(0, 0, 1, 0.99))
    return figure


@picture
def fit_figure(summary: FitSummary, *, wheel_units: bool) -> Figure:
    """Draw a fit: readings and free run, what the free run misses, and the autocorrelation of the one-step residual."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    unit, scale = ("rpm", RAD_S_PER_RPM) if wheel_units else ("rad/s", 1.0)
    of = summary.residual
    time_s = of.time_s - of.time_s[0]
    figure = Figure(figsize=(10, 8), layout="constrained")
    speed, missed, lags = figure.subplots(3, 1, height_ratios=[1.6, 1.2, 1.0])
    speed.plot(time_s, of.measured_rad_s / scale, ".", ms=2, color=GREY, label="measured")
    speed.plot(time_s, of.free_run_rad_s / scale, lw=1.0, color=BLUE, label="free run")
    speed.set_ylabel(f"speed [{unit}]")
    missed.plot(time_s, (of.measured_rad_s - of.free_run_rad_s) / scale, ".", ms=2, color=BLUE)
    missed.set_ylabel(f"free run misses [{unit}]")
    missed.set_xlabel("time [s]")
    correlation = summary.autocorrelation
    lags.axhspan(-summary.white_band, summary.white_band, color=BLUE, alpha=0.15, lw=0, label="95 % of noise")
    lags.bar(np.arange(1, correlation.size + 1), correlation, width=0.4, color=GREY)
    lags.xaxis.set_major_locator(MaxNLocator(integer=True))
    lags.set_ylabel("autocorrelation\nof the one-step residual")
    lags.set_xlabel("lag [readings]")
    legend(speed)
    legend(lags)
    for axis in (speed, missed, lags):
        axis.grid(visible=True, alpha=0.25)
    figure.suptitle(printable(f"{summary.log}: free run {summary.free_run_percent:.2f} %"), fontsize=12)
    return figure


def _draw_innovation(axis: Any, time_s: Any, columns: Mapping[str, Any], *, wheel_units: bool) -> None:
    unit, scale = ("rpm", RAD_S_PER_RPM) if wheel_units else ("rad/s", 1.0)
    innovation = np.asarray(columns["innovation_rad_s"]) / scale
    band = 3.0 * np.asarray(columns["innovation_std_rad_s"]) / scale
    axis.fill_between(time_s, -band, band, color=BLUE, alpha=0.15, lw=0, label="3 sigma")
    axis.plot(time_s, innovation, ".", ms=2, color=BLUE)
    rejected = ~np.asarray(columns["accepted"], dtype=bool) & np.isfinite(innovation)
    if rejected.any():
        axis.plot(time_s[rejected], innovation[rejected], "x", ms=5, color=RED, label="rejected")
    typical = float(np.nanmedian(band)) if np.isfinite(band).any() else 1.0
    axis.set_ylim(-2.0 * typical, 2.0 * typical)
    axis.set_ylabel(f"innovation [{unit}]")
    legend(axis)


def _draw_parameter(axis: Any, time_s: Any, columns: Mapping[str, Any], name: str, truth: float | None) -> None:
    value = np.asarray(columns[name], dtype=np.float64)
    band = 3.0 * np.asarray(columns[f"std_{name}"], dtype=np.float64)
    axis.fill_between(time_s, value - band, value + band, color=BLUE, alpha=0.15, lw=0)
    axis.plot(time_s, value, lw=1.2, color=BLUE, label="estimate as it went, 3 sigma")
    if truth is not None:
        axis.axhline(truth, ls="--", lw=1.0, color=RED, label="truth")
    # The band of the prior dwarfs everything later: show what is left after the first tenth of the run.
    late = slice(max(1, value.size // 10), None)
    if value[late].size:
        low, high = float(np.min((value - band)[late])), float(np.max((value + band)[late]))
        if truth is not None:
            low, high = min(low, truth), max(high, truth)
        pad = 0.1 * (high - low) if high > low else max(abs(high), 1e-12)
        if math.isfinite(low) and math.isfinite(high):
            axis.set_ylim(low - pad, high + pad)
    axis.set_ylabel(f"{_TITLES[name]}\n[{STATE_UNITS[name]}]", fontsize=9)
    legend(axis)


def _draw_hindsight(axis: Any, time_s: Any, belief: Belief, name: str) -> None:
    """At the end of the curve, whose limits grow where they have to."""
    value, std = getattr(belief.parameters, name), getattr(belief.core.parameter_std, name)
    axis.errorbar(time_s[-1:], [value], [3.0 * std], fmt="o", ms=3, capsize=3, color=GREY, label="in hindsight")
    low, high = axis.get_ylim()
    axis.set_ylim(min(low, value - 3.5 * std), max(high, value + 3.5 * std))
    legend(axis)
