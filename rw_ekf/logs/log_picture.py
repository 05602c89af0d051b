"""A log as a picture: speed and current over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.console import printable
from rw_ekf.drawing import picture
from rw_ekf.units import RAD_S_PER_RPM

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rw_ekf.logs.wheel_log import WheelLog

BLUE, RED, GREY = "#1f5fa8", "#c0392b", "#8a8f98"


@picture
def log_figure(log: WheelLog) -> Figure:
    """Draw what a log holds: speed and current over time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4))
    axis = figure.subplots()
    draw_speed(axis, log.time_s - log.time_s[0], log, {}, wheel_units=log.in_rpm)
    axis.set_xlabel("time [s]")
    figure.suptitle(printable(log.name), fontsize=12)
    figure.tight_layout()
    return figure


def draw_speed(axis: Any, time_s: Any, log: WheelLog, columns: Mapping[str, Any], *, wheel_units: bool) -> None:
    """Draw what was measured, the current, and an estimate where `columns` have one."""
    unit, scale = ("rpm", RAD_S_PER_RPM) if wheel_units else ("rad/s", 1.0)
    measured = log.speed_rad_s / scale
    axis.plot(time_s, measured, ".", ms=2, color=GREY, label="measured")
    if "speed_rad_s" in columns:
        axis.plot(time_s, np.asarray(columns["speed_rad_s"]) / scale, lw=1.0, color=BLUE, label="estimate")
    axis.set_ylabel(f"speed [{unit}]")
    current = axis.twinx()
    drive = 1e3 * log.current_A if wheel_units else log.current_A
    current.step(time_s, drive, where="post", lw=0.7, color=RED, alpha=0.45)
    current.set_ylabel("current [mA]" if wheel_units else "drive", color=RED)
    legend(axis)


def legend(axis: Any) -> None:
    """Above the panel, where it hides nothing."""
    axis.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, fontsize=8, frameon=False, borderaxespad=0.1,
        handlelength=1.4, columnspacing=1.4,
    )  # fmt: skip
