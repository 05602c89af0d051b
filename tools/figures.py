"""The figures of docs/: python -m tools.figures [DIR]. SVG with text as text, the same bytes for the same code.

Curves are computed from the project's own friction law, profile and split; the wheel is drawn with more break-away
friction than a real one has, so that it can be seen.
"""

from __future__ import annotations

import argparse
import io
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from rw_ekf.arrays import Float64Array
from rw_ekf.control.profiles import make_profile
from rw_ekf.diagnosis.prepare.split import split_record
from rw_ekf.diagnosis.report.canvas import AFTER, BEFORE, GREY, INK, PALE, plain
from rw_ekf.model.friction import GAUSS, acceleration, friction
from rw_ekf.model.state import CK13_STATISTICAL as WHEEL
from rw_ekf.units import rad_s_from_rpm, rpm_from_rad_s

DIRECTORY = Path(__file__).parents[1] / "docs" / "figures"
OMEGA_S = rad_s_from_rpm(4.0)
_STEP_S, _PERIOD_S = 2.0e-3, 0.1


def new_figure(width_in: float, height_in: float) -> Figure:
    """A white figure: the pages are read on dark grounds too."""
    return Figure(figsize=(width_in, height_in), facecolor="white")


def labelled(axis: Any, x: str, y: str) -> None:
    """Plain axes with their quantities."""
    plain(axis)
    axis.set_xlabel(x, fontsize=9.5, color=INK)
    axis.set_ylabel(y, fontsize=9.5, color=INK)


def note(axis: Any, text: str, at: tuple[float, float], to: tuple[float, float] | None = None, **style: Any) -> None:
    """A word at a place in the data, with an arrow where it points to one."""
    arrow = None if to is None else {"arrowstyle": "->", "color": GREY, "lw": 0.9}
    axis.annotate(text, xy=to or at, xytext=at, fontsize=9, arrowprops=arrow, **{"color": INK, "ha": "center"} | style)


def integrated(current_A: Callable[[float], float], seconds: float, offset_rad_s2: float = 0.0) -> Float64Array:
    """Speed [rad/s] every 0.1 s of the wheel at rest at first, with a torque from outside; simple small steps."""
    omega, speeds = 0.0, [0.0]
    every = round(_PERIOD_S / _STEP_S)
    for i in range(round(seconds / _STEP_S)):
        drive = WHEEL.motor_gain * current_A(i // every * _PERIOD_S) - offset_rad_s2
        after = omega + _STEP_S * acceleration(omega, drive, WHEEL.viscous, WHEEL.coulomb, WHEEL.static, OMEGA_S, GAUSS)
        omega = 0.0 if omega * after < 0.0 else after
        if (i + 1) % every == 0:
            speeds.append(omega)
    return np.array(speeds)


def friction_curve() -> Figure:
    """Friction against speed: stick, Stribeck, viscous."""
    figure = new_figure(7.2, 3.4)
    axis = figure.add_subplot()
    c, s, b = 1.0, 1.5, 0.028
    u = np.concatenate([np.linspace(0.0, 4.0, 90), np.linspace(4.2, 20.0, 12)])
    whole = [friction(v, b, c, s, 1.0, GAUSS) for v in u]
    for sigma in (-1.0, 1.0):
        axis.plot(sigma * u, sigma * np.array(whole), color=AFTER, lw=2.2)
        axis.plot(sigma * u, sigma * (c + b * u), color=GREY, lw=1.0, ls="--")
    axis.plot([0.0, 0.0], [-s, s], color=BEFORE, lw=3.0)
    axis.set_xlim(-20.0, 20.0)
    axis.set_ylim(-1.9, 2.1)
    labelled(axis, "speed ω, in Stribeck speeds (4 rpm)", "friction per unit inertia")
    axis.set_yticks([-s, -c, 0.0, c, s], ["−s", "−c", "0", "c", "s"])
    note(
        axis, "at rest: whatever is needed to hold\nthe wheel, up to break-away friction s", (-10.0, 0.62), (-0.2, 0.5)
    )
    note(axis, "Stribeck: from s to c\nwithin two Stribeck speeds", (6.8, 1.72), (1.0, 1.25))
    note(axis, "Coulomb c + viscous b ω", (14.5, 0.92), (15.0, 1.38))
    return figure


def free_run() -> Figure:
    """What a free run is: the readings, the one-step prediction, and the run from the first speed alone."""
    figure = new_figure(7.6, 4.4)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(1.6, 1.0))
    seconds = 60.0
    time = np.arange(0.0, seconds + 0.5 * _PERIOD_S, _PERIOD_S)

    def current(t: float) -> float:
        return 0.11 * math.sin(2.0 * math.pi * t / 30.0)

    truth = rpm_from_rad_s(1.0) * integrated(current, seconds, offset_rad_s2=0.03)
    readings = truth + np.random.default_rng(1).normal(0.0, 1.0, truth.size)
    free = rpm_from_rad_s(1.0) * integrated(current, seconds)
    one_step = truth + rpm_from_rad_s(0.03 * _PERIOD_S)  # one interval from the true speed, without the offset
    top.plot(time[::4], readings[::4], ".", color=GREY, ms=3.0, label="readings")
    top.plot(time[::2], one_step[::2], color=AFTER, lw=1.2, label="one step ahead, from the filtered speed")
    top.plot(time[::2], free[::2], color=BEFORE, lw=1.6, label="free run, from the first speed alone")
    labelled(top, "", "speed [rpm]")
    top.legend(fontsize=8.5, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    bottom.plot(time[::2], (readings - one_step)[::2], color=AFTER, lw=0.8)
    bottom.plot(time[::2], (readings - free)[::2], color=BEFORE, lw=1.2)
    labelled(bottom, "time [s]", "error [rpm]")
    note(bottom, "one step ahead, the missing torque hides in the noise", (30.0, 5.0), color=AFTER)
    note(bottom, "in a free run it adds up (5 % of Coulomb friction)", (30.0, -13.0), color=BEFORE)
    bottom.set_ylim(-15.0, 9.0)
    return figure


def held_out() -> Figure:
    """How blocks are held out: the search sees every other one, and is judged on the rest."""
    figure = new_figure(7.6, 3.4)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1.0))
    profile = make_profile("identification")
    seconds = profile.duration_s or 600.0
    speed = integrated(profile.current_A, seconds)
    time: Float64Array = np.arange(speed.size, dtype=np.float64) * _PERIOD_S
    split = split_record(time, np.zeros(speed.size, dtype=np.int64), speed, "blocks", rad_s_from_rpm(1.0))
    top.plot(time[::5], rpm_from_rad_s(1.0) * speed[::5], color=INK, lw=0.8)
    labelled(top, "", "speed [rpm]")
    for block in np.unique(split.block):
        inside = np.flatnonzero(split.block == block)
        begin, end = time[inside[0]], time[inside[-1]]
        searched = bool(split.fit[inside[0]])
        for axis in (top, bottom):
            axis.axvspan(begin, end, color="white" if searched else PALE, lw=0, zorder=0)
        bottom.plot([begin + 2.0, end - 2.0], [float(searched)] * 2, color=AFTER if searched else BEFORE, lw=4.0)
    bottom.set_ylim(-0.7, 1.7)
    labelled(bottom, "time [s]", "")
    bottom.set_yticks([0.0, 1.0], ["held out: free run\nfrom its first speed", "fitted"])
    bottom.grid(visible=False)
    top.set_xlim(0.0, seconds)
    return figure


def bristle() -> Figure:
    """Friction on a bristle against the angle: a spring below break-away, a plateau beyond, hysteresis between."""
    figure = new_figure(7.2, 3.2)
    axis = figure.add_subplot()
    for reach, colour in ((0.8, AFTER), (6.0, BEFORE)):
        angle = 0.5 * reach * (1.0 - np.cos(np.linspace(0.0, 4.0 * math.pi, 8001)))
        bent, course = 0.0, []
        for moved in np.diff(angle):
            bent += moved - abs(moved) * bent  # docs/effects.md eq. 8 without damping, T = s
            course.append(bent)
        axis.plot(angle[1::40], course[::40], color=colour, lw=1.8, label=f"to and fro over {reach:g} deflections")
    labelled(axis, "angle since rest, in deflections at break-away", "friction / s")
    axis.axhline(0.0, color=GREY, lw=0.8)
    axis.set_ylim(-1.3, 1.3)
    axis.legend(fontsize=8.5, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    note(axis, "little motion: nearly a spring", (2.6, 0.25), (0.55, 0.4))
    note(axis, "sliding: the bristle stays bent", (4.2, 1.12))
    note(axis, "turning back: it unbends first", (3.6, -0.35), (5.2, -0.12))
    return figure


def sample_path() -> Figure:
    """The path of one sample through the daemon's loop."""
    figure = new_figure(8.4, 3.3)
    axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axis.set_axis_off()
    axis.set_xlim(0.0, 84.0)
    axis.set_ylim(0.0, 33.0)

    def box(x: float, y: float, title: str, words: str, colour: str = PALE) -> None:
        axis.add_patch(FancyBboxPatch((x, y), 14.0, 7.0, boxstyle="round,pad=0.3", fc=colour, ec=GREY, lw=0.9))
        axis.text(x + 7.0, y + 4.9, title, ha="center", va="center", fontsize=9.5, color=INK, weight="bold")
        axis.text(x + 7.0, y + 2.0, words, ha="center", va="center", fontsize=8, color=INK, linespacing=1.15)

    def arrow(begin: tuple[float, float], end: tuple[float, float], words: str = "", above: float = 1.2) -> None:
        axis.annotate("", end, begin, arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.2})
        middle = (0.5 * (begin[0] + end[0]), 0.5 * (begin[1] + end[1]) + above)
        axis.text(*middle, words, ha="center", va="center", fontsize=8, color=GREY)

    box(1.0, 13.0, "wheel", "real, simulated,\nor a log", "white")
    box(19.0, 22.0, "driver", "bytes to SI,\nthe wheel's clock")
    box(36.0, 22.0, "telemetry check", "silent? stuck?\nrestarted?")
    box(53.0, 22.0, "filter", "predict, gate,\nupdate")
    box(69.0, 13.0, "sinks", "log, estimates,\nstate file", "white")
    box(53.0, 4.0, "controller", "a profile asks\nfor a current")
    box(19.0, 4.0, "guard", "finite, limits,\nslew; else zero", "#fbe9df")
    arrow((8.0, 20.5), (18.5, 25.5), "reading", 1.8)
    arrow((33.5, 25.5), (35.5, 25.5))
    arrow((50.5, 25.5), (52.5, 25.5))
    arrow((60.0, 21.5), (60.0, 11.5))
    axis.text(60.8, 16.5, "estimate", fontsize=8, color=GREY, va="center")
    arrow((67.5, 25.5), (76.0, 20.5))
    axis.text(
        78.0, 24.6, "tick: sample, estimate,\ncommand, alarms, link", fontsize=8, color=GREY, ha="center", va="center"
    )
    arrow((52.5, 7.5), (33.5, 7.5), "request")
    arrow((18.5, 7.5), (8.0, 12.5), "current", -1.8)
    axis.text(
        43.0, 16.5, "once per cycle, every 100 ms", fontsize=9, color=GREY, ha="center", va="center", style="italic"
    )
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {
    "friction-curve": friction_curve,
    "free-run": free_run,
    "held-out-blocks": held_out,
    "bristle": bristle,
    "sample-path": sample_path,
}


def draw(directory: Path) -> list[Path]:
    """Write every figure into `directory`; returns the files."""
    directory.mkdir(parents=True, exist_ok=True)
    written = []
    with mpl.rc_context({"svg.hashsalt": "rw_ekf", "svg.fonttype": "none"}):
        for name, figure in FIGURES.items():
            written.append(directory / f"{name}.svg")
            text = io.StringIO()
            figure().savefig(text, format="svg", metadata={"Date": None, "Creator": None}, bbox_inches="tight")
            # Hundredths of a point are enough, and the same on every machine.
            short = re.sub(r"\d+\.\d{3,}", lambda number: f"{float(number[0]):.2f}", text.getvalue())
            written[-1].write_text(re.sub(r" +$", "", short, flags=re.MULTILINE), encoding="utf-8")
    return written


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Draw the figures of docs/.")
    parser.add_argument("directory", nargs="?", type=Path, default=DIRECTORY, metavar="DIR")
    for path in draw(parser.parse_args().directory):
        print(path)
