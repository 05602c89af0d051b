"""What no effect explains, drawn: the curves of `shapes` in the document, each with a band of two sigma."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.diagnosis.report.canvas import AFTER, BEFORE, GREY, INK, new_figure, plain, png, time_axis
from rw_ekf.diagnosis.report.markup import prose
from rw_ekf.drawing import picture

if TYPE_CHECKING:
    from rw_ekf.diagnosis.result import Diagnosis

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


def shapes_picture(diagnosis: Diagnosis) -> bytes | None:
    """A panel for each curve; None where nothing is left."""
    shapes = diagnosis.document().get("shapes")
    return _panels(diagnosis, shapes) if shapes else None


@picture
def _panels(diagnosis: Diagnosis, shapes: Sequence[Mapping[str, Any]]) -> bytes:
    from matplotlib.ticker import MaxNLocator

    figure, time = new_figure(3.1), time_axis(diagnosis.log)
    named = (diagnosis.document().get("verdict") or {}).get("kind") == "effect"
    for axis, shape in zip(figure.subplots(1, len(shapes), squeeze=False)[0], shapes, strict=True):
        at, value, std = (np.asarray(shape[key], dtype=np.float64) for key in ("at", "value", "std"))
        along, unit = _ALONG[shape["dependence"]], str(shape["at_unit"])
        if shape["dependence"] == "time":
            at, unit = (at - time.start_s) / time.unit_s, time.unit
        colour = AFTER if named else BEFORE
        plain(axis)
        axis.axhline(0.0, color=GREY, lw=0.8, zorder=1)
        axis.fill_between(at, value - 2.0 * std, value + 2.0 * std, color=colour, alpha=0.18, lw=0)
        axis.plot(at, value, color=colour, lw=1.8, marker="o" if at.size < 20 else None, ms=3.4)
        axis.margins(x=0.02)
        axis.xaxis.set_major_locator(MaxNLocator(6))
        axis.set_xlabel(f"{along} [{unit.replace('degC', '°C')}]", fontsize=9)
        axis.set_ylabel(f"{_KINDS[shape['kind']]} [{str(shape['unit']).replace('^2', '²')}]", fontsize=8.5)
        axis.set_title(shape["dependence"], fontsize=10, loc="left", color=INK)
    return png(figure)


def shapes_caption(document: Mapping[str, Any]) -> str:
    """One sentence of what was found, and how to read the curves."""
    shapes = list(document.get("shapes") or ())
    found = f"<strong>{_capital(prose(str(shapes[0]['sentence'])))}.</strong> " if shapes else ""
    more = "".join(f" Against {shape['dependence']}: {prose(str(shape['sentence']))}." for shape in shapes[1:])
    return (
        f"{found}{more.strip()}{' ' if more else ''}Best fit beside the model's own parameters, with a band of two "
        "sigma. What those can follow, a constant drag or one that is proportional to speed, is in no curve. One cause "
        "bends several curves: the first is the most significant."
    )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
