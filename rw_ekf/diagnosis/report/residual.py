"""The residual against everything it could depend on, before and after: bent is an effect, flat is none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array
from rw_ekf.diagnosis.report.canvas import (
    AFTER,
    GREY,
    INK,
    BinnedMeans,
    Margins,
    binned_means,
    colour_of_first,
    correlation_samples,
    ground,
    legend,
    new_figure,
    plain,
    png,
    point_indices,
    shade,
    time_axis,
    with_margins,
)
from rw_ekf.diagnosis.report.words import Units
from rw_ekf.drawing import picture
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.units import RAD_S_PER_RPM

if TYPE_CHECKING:
    from rw_ekf.diagnosis.result import Diagnosis


_MOST_BINS, _FEWEST_BINS = 28, 10
_INDEPENDENT_IN_BIN = 30.0
_MOST_POINTS = 3000
_STRUCTURE_WINDOW_S = 20.0
_TICKS, _TICKS_IN_TIME = 5, 9  # the panel of time is twice as wide
_LOW_SPEED_RAD_S = 40.0 * RAD_S_PER_RPM  # of a wheel
_LOW_STRIBECK_SPEEDS = 12.0
_BETWEEN = 0.13  # of a panel's width, between neighbours
_FEW_HELDOUT = 200  # below so many held-out samples the whole record is shown


@dataclass(eq=False, frozen=True)
class Panel:
    """One panel: the residual against one quantity."""

    title: str
    label: str
    x: Float64Array  # (n,)
    mask: BoolArray  # (n,) samples it is judged on
    low: float
    high: float
    finest: bool = False  # with as many bins as may be: waves within a turn
    along_motion: bool = False  # times the speed's sign: braking is negative in both directions
    in_time: bool = False


@dataclass(eq=False, frozen=True)
class Series:
    """One model's residual in the report's unit."""

    label: str
    colour: str
    marker: str
    values: Float64Array  # (n,)
    correlation: float


@picture
def residual_picture(diagnosis: Diagnosis, units: Units) -> bytes | None:
    """A panel for each quantity, both models in each, one scale throughout; None without a residual."""
    series = _series(diagnosis, units)
    if not series or len(diagnosis.log) == 0:
        return None
    sign = np.sign(diagnosis.log.speed_rad_s)
    panels = panels_of(diagnosis, units)
    means = [[_means(panel, one, sign) for one in series] for panel in panels]
    if not any(found.count.size for row in means for found in row):
        return None
    layout = _layout(len(panels))
    figure = new_figure(0.5 + 2.55 * len(layout), measured=False)
    drawn: dict[str, Any] = figure.subplot_mosaic(layout, sharey=True)  # type: ignore[arg-type]
    axes = [drawn[str(number)] for number in range(len(panels))]
    marked = _marked(diagnosis, panels, means)
    extent = _extent(means)
    if (diagnosis.document().get("verdict") or {}).get("kind") == "adequate":
        # Nothing but noise is left: on the scale of single samples its means look as flat as they are.
        extent = max(extent, _scatter(series[0].values))
    shown = point_indices(np.isfinite(series[0].values), _MOST_POINTS)
    for number, (axis, panel, row) in enumerate(zip(axes, panels, means, strict=True)):
        handles = [_draw(axis, panel, one, found, sign, shown) for one, found in zip(series, row, strict=True)]
        _dress(axis, panel, row, units, extent, marked=number in marked)
        if panel.in_time:
            shade(axis, time_axis(diagnosis.log), diagnosis.heldout)
        if axis.get_subplotspec().is_first_col():
            axis.set_ylabel(f"residual [{units.residual}]", fontsize=9.5)
        else:
            axis.tick_params(labelleft=False)
    axes[0].set_ylim(-extent, extent)
    entries: list[tuple[Any, str]] = [(handle, one.label) for handle, one in zip(handles, series, strict=True)]
    entries.append((ground(), "held out"))
    legend(figure, entries)
    with_margins(figure, Margins(above=0.66, rows=0.85), rows=len(layout))
    figure.subplots_adjust(wspace=_BETWEEN)
    return png(figure)


def _marked(diagnosis: Diagnosis, panels: list[Panel], means: list[list[BinnedMeans]]) -> set[int]:
    """Panels whose title is bold: those of the causes that are named; without a name, the largest dependence."""
    verdict = diagnosis.document().get("verdict") or {}
    if verdict.get("kind") == "adequate":
        return set()
    named = {CATALOGUE[name].shown_against for name in verdict.get("effects") or () if name in CATALOGUE}
    if verdict.get("kind") == "effect":
        return {number for number, panel in enumerate(panels) if panel.title in named}
    fitted = [shape["dependence"] for shape in diagnosis.document().get("shapes") or ()][:1]
    titles = {"current", "drive"} if fitted == ["current"] else set(fitted)
    largest = {number for number, panel in enumerate(panels) if panel.title in titles}
    return largest or {int(np.argmax([np.nan_to_num(row[0].structure) for row in means]))}


def _layout(panels: int) -> list[list[str]]:
    """Numbers of the panels as they stand; time takes what is over."""
    rows = {1: "0", 2: "01", 3: "00 12", 4: "01 23", 5: "001 234", 6: "012 345"}[panels]
    return [list(row) for row in rows.split()]


def _series(diagnosis: Diagnosis, units: Units) -> list[Series]:
    """The residuals there are; alone, the model's own is red only where structure is left in it."""
    rate_hz = diagnosis.log.rate_hz
    window = max(51, int(_STRUCTURE_WINDOW_S * rate_hz)) if np.isfinite(rate_hz) else 51
    before = diagnosis.before
    if before is None:
        return []
    # The better model's noise is the noise of both: what the other has beyond it is structure.
    cleanest = (diagnosis.after or before).residual_acceleration_rad_s2
    correlation = correlation_samples(cleanest, window)
    values = before.residual_acceleration_rad_s2 / units.residual_scale
    colour = colour_of_first(diagnosis)
    if diagnosis.after is None:
        return [Series("mean ± 2 standard errors", colour, "o", values, correlation)]
    improved = diagnosis.after.residual_acceleration_rad_s2 / units.residual_scale
    return [
        Series("before: mean ± 2 standard errors", colour, "o", values, correlation),
        Series("after: mean ± 2 standard errors", AFTER, "s", improved, correlation),
    ]


def panels_of(diagnosis: Diagnosis, units: Units) -> list[Panel]:
    """What the residual is drawn against: what this log has, and what it varies in."""
    log, time = diagnosis.log, time_axis(diagnosis.log)
    everything = np.ones(len(log), dtype=bool)
    judged = diagnosis.heldout if np.count_nonzero(diagnosis.heldout) >= _FEW_HELDOUT else everything
    speed = log.speed_rad_s / units.speed_scale
    slow = _low_speed(diagnosis) / units.speed_scale
    drive = "current" if units.wheel else "drive"
    panels = [
        Panel("time", time.label, time.values, everything, time.values[0], time.values[-1], in_time=True),
        _panel("speed", f"speed [{units.speed}]", speed, judged),
        Panel(
            "low speed", f"|speed| [{units.speed}], residual along the motion", np.abs(speed), judged, 0.0, slow,
            along_motion=True,
        ),
        _panel(drive, f"{drive} [{units.current}]", log.current_A / units.current_scale, judged),
    ]  # fmt: skip
    if diagnosis.angle_rad is not None:
        angle = np.where(np.isfinite(diagnosis.angle_rad), diagnosis.angle_rad, np.nan)
        turn = np.degrees(np.mod(angle, 2.0 * np.pi))
        label = "angle within a turn [deg]" if diagnosis.angle_is_logged else "angle within a turn, integrated [deg]"
        panels.append(Panel("angle", label, turn, judged, 0.0, 360.0, finest=True))
    if diagnosis.temperature_degC is not None:
        panels.append(_panel("temperature", "temperature [°C]", diagnosis.temperature_degC, judged))
    return [panel for panel in panels if panel.high > panel.low]


def _panel(title: str, label: str, x: Float64Array, mask: BoolArray) -> Panel:
    """A range that single stray readings do not widen."""
    known = x[mask & np.isfinite(x)]
    low, high = (
        (float(v) for v in np.percentile(known[:: 1 + known.size // 200_000], (0.1, 99.9)))
        if known.size
        else (0.0, 0.0)
    )
    return Panel(title, label, x, mask, low, high)


def _low_speed(diagnosis: Diagnosis) -> float:
    """Up to where friction near rest matters [rad/s]: some Stribeck speeds, never more than a quarter of the range."""
    speed = np.abs(diagnosis.log.speed_rad_s)
    top = float(np.nanpercentile(speed, 99.0)) if np.isfinite(speed).any() else 0.0
    model = diagnosis.model
    low = _LOW_SPEED_RAD_S if model is None else _LOW_STRIBECK_SPEEDS * model.stribeck_speed_rad_s
    return min(low, 0.25 * top)


def _means(panel: Panel, one: Series, sign: Float64Array) -> BinnedMeans:
    values = one.values * sign if panel.along_motion else one.values
    independent = np.count_nonzero(panel.mask) / one.correlation
    bins = _MOST_BINS if panel.finest else int(np.clip(independent / _INDEPENDENT_IN_BIN, _FEWEST_BINS, _MOST_BINS))
    edges = np.linspace(panel.low, panel.high, bins + 1)
    return binned_means(panel.x, values, panel.mask, edges, one.correlation)


def _extent(means: list[list[BinnedMeans]]) -> float:
    """One scale for all panels: what the means need; single wild bins may leave the picture."""
    sizes = np.concatenate([np.abs(found.mean) + 2.0 * found.standard_error for row in means for found in row])
    extent = 1.25 * float(np.percentile(sizes, 98.0))
    return extent if np.isfinite(extent) and extent > 0.0 else 1.0


def _scatter(values: Float64Array) -> float:
    """Twice the spread of single samples, strays left out."""
    known = values[np.isfinite(values)]
    return float(np.percentile(np.abs(known), 95.0)) if known.size else 0.0


def _draw(axis: Any, panel: Panel, one: Series, found: BinnedMeans, sign: Float64Array, shown: Int64Array) -> Any:
    """Faint points, and the means over them."""
    index = shown[panel.mask[shown]]
    points = (one.values * sign if panel.along_motion else one.values)[index]
    axis.plot(panel.x[index], points, ".", ms=2.2, mew=0.0, color=one.colour, alpha=0.22, rasterized=True)
    return axis.errorbar(
        found.x, found.mean, 2.0 * found.standard_error, color=one.colour, marker=one.marker, ms=3.4, lw=1.4,
        elinewidth=0.9,
    )  # fmt: skip


def _dress(axis: Any, panel: Panel, row: list[BinnedMeans], units: Units, extent: float, *, marked: bool) -> None:
    """Title with the size of the structure in the means, to a hundredth of the scale; bold where it is marked."""
    from matplotlib.ticker import MaxNLocator

    plain(axis)
    axis.axhline(0.0, color=GREY, lw=0.8, zorder=1)
    axis.set_xlim(panel.low, panel.high)
    axis.xaxis.set_major_locator(MaxNLocator(_TICKS_IN_TIME if panel.in_time else _TICKS))
    axis.set_xlabel(panel.label, fontsize=9)
    # With a height of its own a title is not moved out of the way of ticks, for which all of them would be laid out.
    axis.set_title(panel.title, fontsize=10, loc="left", y=1.0, color=INK, weight="bold" if marked else "normal")
    places = int(np.clip(2 - np.floor(np.log10(extent)), 0, 9))
    sizes = " → ".join(f"{found.structure:.{places}f}" for found in row)
    structures = [found.structure for found in row]
    told = f"{sizes} {units.residual}" if np.isfinite(structures).all() else "too few samples"
    if not any(float(f"{size:.{places}f}") for size in structures):
        told = "nothing beyond noise"
    axis.set_title(told, fontsize=8.5, loc="right", y=1.0, color=GREY)
