"""The residual against everything it could depend on, before and after: bent is an effect, flat is none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.diagnosis.report.binning import BinnedMeans, point_indices
from rw_ekf.diagnosis.report.canvas import GREY, INK, ground, legend, new_figure, plain, png, shade
from rw_ekf.diagnosis.report.quantities import DrawnModel, Quantity, correlation_of, models_of, quantities_of
from rw_ekf.diagnosis.report.words import Units
from rw_ekf.drawing import picture
from rw_ekf.effects.catalogue import CATALOGUE

if TYPE_CHECKING:
    from rw_ekf.diagnosis.outcome import Outcome

_MOST_POINTS = 3000


@dataclass(eq=False, frozen=True)
class Panel:
    """One panel: a quantity, and for each model its residual (n,) and the means of that."""

    quantity: Quantity
    values: Sequence[Float64Array]
    means: Sequence[BinnedMeans]
    marked: bool


@dataclass(eq=False, frozen=True)
class ResidualView:
    """What the picture shows."""

    panels: Sequence[Panel]
    models: Sequence[DrawnModel]
    unit: str
    extent: float  # the common scale reaches so far both ways
    heldout: BoolArray


def residual_view(diagnosis: Outcome, units: Units) -> ResidualView | None:
    """The arrays of the picture, in the report's units; None without a residual."""
    models = models_of(diagnosis)
    if not models or len(diagnosis.log) == 0:
        return None
    correlation, sign = correlation_of(diagnosis), np.sign(diagnosis.log.speed_rad_s)
    residuals = [model.trace.residual_acceleration_rad_s2 / units.residual_scale for model in models]
    quantities = quantities_of(diagnosis, units)
    values = [[one * sign if quantity.along_motion else one for one in residuals] for quantity in quantities]
    means = [[q.means(one, correlation) for one in row] for q, row in zip(quantities, values, strict=True)]
    if not any(found.count.size for row in means for found in row):
        return None
    document = diagnosis.document()
    marked, extent = _marked(document, quantities, means), _extent(means)
    if (document.get("verdict") or {}).get("kind") == "adequate":
        # Nothing but noise is left: on the scale of single samples its means look as flat as they are.
        extent = max(extent, _scatter(residuals[0]))
    panels = [
        Panel(*parts, marked=number in marked)
        for number, parts in enumerate(zip(quantities, values, means, strict=True))
    ]
    return ResidualView(panels, models, units.residual, extent, diagnosis.heldout)


@picture
def residual_picture(view: ResidualView | None) -> bytes | None:
    """A panel for each quantity, both models in each, one scale throughout, as a PNG; None without a residual."""
    if view is None:
        return None
    rows = (len(view.panels) + 1) // 2
    figure = new_figure(0.3 + 2.0 * rows)
    # Time takes the place that is over.
    places = [*"aa"[: len(view.panels) % 2], *(chr(ord("a") + number) for number in range(len(view.panels)))]
    drawn: dict[str, Any] = figure.subplot_mosaic(
        [places[2 * row : 2 * row + 2] for row in range(rows)] if len(view.panels) > 1 else [["a"]], sharey=True
    )
    for axis, panel in zip(drawn.values(), view.panels, strict=True):
        handles = [
            _draw(axis, panel.quantity, *one) for one in zip(view.models, panel.values, panel.means, strict=True)
        ]
        _dress(axis, panel, view)
        axis.set_ylim(-view.extent, view.extent)
        if axis.get_subplotspec().is_first_col():
            axis.set_ylabel(f"residual [{view.unit}]", fontsize=8.5)
    names = [f"{model.name}: " if len(view.models) > 1 else "" for model in view.models]
    entries = [(handle, f"{name}mean ± 2 standard errors") for handle, name in zip(handles, names, strict=True)]
    legend(figure, [*entries, (ground(), "held out")])
    return png(figure)


def _draw(axis: Any, quantity: Quantity, model: DrawnModel, values: Float64Array, found: BinnedMeans) -> Any:
    """Faint points, and the means over them; returns what the legend shows."""
    index = point_indices(quantity.mask & np.isfinite(values), _MOST_POINTS)
    axis.plot(quantity.x[index], values[index], ".", ms=2.2, mew=0.0, color=model.colour, alpha=0.22)
    return axis.errorbar(
        found.x, found.mean, 2.0 * found.standard_error, color=model.colour, marker=model.marker, ms=3.2, lw=1.3,
        elinewidth=0.9,
    )  # fmt: skip


def _dress(axis: Any, panel: Panel, view: ResidualView) -> None:
    """Title with the size of the structure in the means, to a hundredth of the scale; bold where it is marked."""
    from matplotlib.ticker import MaxNLocator

    quantity = panel.quantity
    plain(axis)
    axis.axhline(0.0, color=GREY, lw=0.8, zorder=1)
    axis.set_xlim(quantity.low, quantity.high)
    axis.xaxis.set_major_locator(MaxNLocator(5))
    axis.set_xlabel(quantity.label + (", residual along the motion" if quantity.along_motion else ""), fontsize=8.5)
    if quantity.in_time:
        shade(axis, quantity.x, view.heldout)
    axis.set_title(quantity.title, fontsize=9.5, loc="left", color=INK, weight="bold" if panel.marked else "normal")
    places = int(np.clip(2 - np.floor(np.log10(view.extent)), 0, 9))
    structures = [found.structure for found in panel.means]
    title = f"{' → '.join(f'{size:.{places}f}' for size in structures)} {view.unit}"
    if not np.isfinite(structures).all():
        title = "too few samples"
    elif not any(float(f"{size:.{places}f}") for size in structures):
        title = "nothing beyond noise"
    axis.set_title(title, fontsize=8.5, loc="right", color=GREY)


def _marked(
    document: Mapping[str, Any], quantities: Sequence[Quantity], means: Sequence[Sequence[BinnedMeans]]
) -> set[int]:
    """Panels whose title is bold: those of the causes that are named; without a name, the largest dependence."""
    verdict = document.get("verdict") or {}
    if verdict.get("kind") == "adequate":
        return set()
    named = {_shown_against(document, name) for name in verdict.get("effects") or () if name in CATALOGUE}
    if verdict.get("kind") == "effect":
        return {number for number, quantity in enumerate(quantities) if quantity.title in named}
    fitted = [shape["dependence"] for shape in document.get("shapes") or ()][:1]
    titles = {"current", "drive"} if fitted == ["current"] else set(fitted)
    largest = {number for number, quantity in enumerate(quantities) if quantity.title in titles}
    return largest or {int(np.argmax([np.nan_to_num(row[0].structure) for row in means]))}


def _shown_against(document: Mapping[str, Any], name: str) -> str:
    """The quantity that an effect is a function of; of a law that which it was found over."""
    entries: list[Any] = [entry for entry in document.get("candidates") or () if entry["effect"] == name]
    parameters = (entries[0].get("parameters") or {}) if entries else {}
    quantity = str((parameters.get("quantity") or {}).get("value", ""))
    return quantity.partition("_")[0] or CATALOGUE[name].shown_against


def _extent(means: Sequence[Sequence[BinnedMeans]]) -> float:
    """One scale for all panels: what the means need; single wild bins may leave the picture."""
    sizes = np.concatenate([np.abs(found.mean) + 2.0 * found.standard_error for row in means for found in row])
    extent = 1.25 * float(np.percentile(sizes, 98.0))
    return extent if np.isfinite(extent) and extent > 0.0 else 1.0


def _scatter(values: Float64Array) -> float:
    """Twice the spread of single samples, strays left out."""
    known = values[np.isfinite(values)]
    return float(np.percentile(np.abs(known), 95.0)) if known.size else 0.0
