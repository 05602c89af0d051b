"""What the pictures of a report share: colours that a colour-blind eye tells apart, plain axes, PNG bytes."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

from rw_ekf.diagnosis.report.thinning import TimeAxis, spans

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from rw_ekf.diagnosis.result import Diagnosis

# Okabe and Ito's vermilion and blue: far apart for every kind of colour vision, and in grey.
BEFORE, AFTER = "#c8500a", "#0067b1"
INK, GREY, PALE = "#1d2126", "#6b727b", "#e9ecf0"
WIDTH_IN = 9.8
_DPI = 150


def new_figure(height_in: float) -> Figure:
    """A figure of the report's width, outside pyplot and its global state."""
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH_IN, height_in), facecolor="white", layout="constrained")


def plain(axis: Any) -> None:
    """Only the frame's lower left, thin grid, grey ticks."""
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
    for side in ("bottom", "left"):
        axis.spines[side].set_color("#aab0b8")
    axis.tick_params(labelsize=8.5, color="#aab0b8", labelcolor=INK)
    axis.grid(visible=True, color=PALE, lw=0.8)
    axis.set_axisbelow(True)


def colour_of_first(diagnosis: Diagnosis) -> str:
    """Colour of the model before: red, unless it stands alone and is all that is needed."""
    kind = (diagnosis.document.get("verdict") or {}).get("kind")
    return AFTER if diagnosis.after is None and kind == "adequate" else BEFORE


def shade(axis: Any, time: TimeAxis, heldout: NDArray[Any]) -> None:
    """Grey ground where the record was held out."""
    # One collection: a long record has thousands of stretches.
    ranges = []
    for first, last in spans(heldout):
        start, end = time.values[first], time.values[min(last + 1, time.values.size - 1)]
        ranges.append((start, end - start))
    if ranges:
        axis.broken_barh(
            ranges, (0.0, 1.0), transform=axis.get_xaxis_transform(), color="#eef0f3", lw=0, zorder=0, clip_on=True
        )


def legend(figure: Figure, entries: list[tuple[Any, str]]) -> None:
    """One line above everything."""
    handles, labels = [handle for handle, _ in entries], [label for _, label in entries]
    figure.legend(
        handles, labels, loc="outside upper left", ncols=len(entries), frameon=False, fontsize=9.5, labelcolor=INK,
        handlelength=1.8, columnspacing=1.8,
    )  # fmt: skip


def ground() -> Any:
    """A legend's handle for the shading of held-out stretches."""
    from matplotlib.patches import Patch

    return Patch(facecolor="#e3e6ea", edgecolor="none")


def png(figure: Figure) -> bytes:
    """The figure as a PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=_DPI, format="png")
    return buffer.getvalue()
