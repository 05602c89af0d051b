"""The wheel rates of a plan over time, one panel for each case."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rw_ekf.drawing import picture
from rw_ekf.flyby.flyby_plan import Case
from rw_ekf.flyby.geometry import Flyby
from rw_ekf.flyby.wheel_rates import rates_at
from rw_ekf.logs.picture_file import save_picture
from rw_ekf.units import RAD_S_PER_RPM

_POINTS = 400


@picture
def plan_picture(path: str | Path, flyby: Flyby, cases: Sequence[Case]) -> None:
    """Draw into a file: dots at crossings, crosses at touches, a line at closest approach. Raises BadInputError."""
    from matplotlib.figure import Figure

    across = min(2, len(cases))
    down = math.ceil(len(cases) / across)
    figure = Figure(figsize=(5.5 * across, 2.6 * down + 0.9), layout="constrained")
    panels = figure.subplots(down, across, sharex=True, squeeze=False)
    angles = np.linspace(flyby.start_rad, flyby.end_rad, _POINTS)
    time_s = np.array([flyby.time_s(angle) for angle in angles]) - flyby.closest_approach_s
    for number, axis in enumerate(panels.flat):
        if number >= len(cases):
            axis.set_visible(False)
            continue
        case = cases[number]
        axis.axhline(0.0, color="black", lw=0.8)
        axis.axvline(0.0, color="#8a8f98", lw=0.8, ls="--")
        for name, speed, course in zip(flyby.wheels.names, rates_at(case.rates, angles), case.courses, strict=True):
            (line,) = axis.plot(time_s, speed / RAD_S_PER_RPM, lw=1.4, label=name)
            for crossing in course.crossings:
                moment, rises = crossing.time_s - flyby.closest_approach_s, crossing.rate_rad_s2 > 0.0
                axis.plot(moment, 0.0, "o", ms=6, color=line.get_color(), mec="black", mew=0.6, zorder=3)
                offset = (5, -11) if rises else (5, 5)  # beside the curve, not on it
                axis.annotate(f"{moment:+.0f} s", (moment, 0.0), xytext=offset, textcoords="offset points", fontsize=8)
            for touch_s in course.touches_s:
                axis.plot(touch_s - flyby.closest_approach_s, 0.0, "x", ms=7, color=line.get_color(), zorder=3)
        axis.set_title(f"start [{', '.join(f'{rate:g}' for rate in case.rates_rpm)}] rpm", fontsize=10)
        axis.set_ylabel("wheel rate [rpm]")
        axis.grid(visible=True, alpha=0.25)
        axis.margins(x=0.01)
    for axis in panels[-1]:
        axis.set_xlabel("time from closest approach [s]")
    handles, labels = panels.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=min(8, len(labels)), fontsize=9)
    save_picture(figure, path)
