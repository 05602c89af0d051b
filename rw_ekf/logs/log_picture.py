"""A log as a picture: speed and current over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rw_ekf.arrays import Float64Array
from rw_ekf.console import printable
from rw_ekf.drawing import picture
from rw_ekf.units import RAD_S_PER_RPM

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLUE, RED, GREY = "#1f5fa8", "#c0392b", "#8a8f98"


@picture
def log_figure(
    name: str, time_s: Float64Array, speed_rad_s: Float64Array, current_A: Float64Array, *, in_rpm: bool
) -> Figure:
    """Draw what a log holds: speed and current (n,) over time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4))
    axis = figure.subplots()
    draw_speed(axis, time_s - time_s[0], speed_rad_s, current_A, None, wheel_units=in_rpm)
    axis.set_xlabel("time [s]")
    figure.suptitle(printable(name), fontsize=12)
    figure.tight_layout()
    return figure


def draw_speed(
    axis: Any,
    time_s: Float64Array,
    speed_rad_s: Float64Array,
    current_A: Float64Array,
    estimate_rad_s: Float64Array | None,
    *,
    wheel_units: bool,
) -> None:
    """Draw what was measured, the current, and an estimate where there is one; all (n,)."""
    unit, scale = ("rpm", RAD_S_PER_RPM) if wheel_units else ("rad/s", 1.0)
    axis.plot(time_s, speed_rad_s / scale, ".", ms=2, color=GREY, label="measured")
    if estimate_rad_s is not None:
        axis.plot(time_s, estimate_rad_s / scale, lw=1.0, color=BLUE, label="estimate")
    axis.set_ylabel(f"speed [{unit}]")
    current = axis.twinx()
    current.step(time_s, 1e3 * current_A if wheel_units else current_A, where="post", lw=0.7, color=RED, alpha=0.45)
    current.set_ylabel("current [mA]" if wheel_units else "drive", color=RED)
    legend(axis)


def legend(axis: Any) -> None:
    """Above the panel, where it hides nothing."""
    axis.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, fontsize=8, frameon=False, borderaxespad=0.1,
        handlelength=1.4, columnspacing=1.4,
    )  # fmt: skip
