"""What the pictures of a report share: colours, axes, legend, PNG bytes.

A colour-blind eye distinguishes the colours. Pictures of a diagnosis are half a page wide: a phone shows their words.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.diagnosis.report.binning import spans

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito's vermilion and blue: far apart for every kind of colour vision, and in grey.
BEFORE, AFTER = "#c8500a", "#0067b1"
INK, GREY, PALE, FRAME = "#1d2126", "#6b727b", "#e9ecf0", "#aab0b8"
WIDTH_IN = 6.2  # two stand side by side, or one fills a phone
_PIXELS = 1500  # of a picture's width
_COLOURS = 128  # a third of the bytes, and no eye sees it
_COMPRESSION = 4  # three quarters of the time of the usual 6, 3 % more bytes


def new_figure(height_in: float, width_in: float = WIDTH_IN) -> Figure:
    """A figure outside pyplot and its global state; its axes leave the room that labels need."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), facecolor="white", layout="constrained")


def plain(axis: Any) -> None:
    """Only the frame's lower left, thin grid, grey ticks."""
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
    for side in ("bottom", "left"):
        axis.spines[side].set_color(FRAME)
    axis.tick_params(labelsize=8.5, color=FRAME, labelcolor=INK)
    axis.grid(visible=True, color=PALE, lw=0.8)
    axis.set_axisbelow(True)


def shade(axis: Any, x: Float64Array, mask: BoolArray) -> None:
    """Grey ground where mask holds along x; one collection, as a long record has thousands of stretches."""
    ranges = [(x[first], x[min(last + 1, x.size - 1)] - x[first]) for first, last in spans(mask)]
    if ranges:
        axis.broken_barh(
            ranges, (0.0, 1.0), transform=axis.get_xaxis_transform(), color="#eef0f3", lw=0, zorder=0, clip_on=True
        )


def legend(figure: Figure, entries: list[tuple[Any, str]], columns: int = 4) -> None:
    """Above everything, the handles that there are with their words."""
    figure.legend(
        [handle for handle, _ in entries], [words for _, words in entries], loc="outside upper left", ncols=columns,
        frameon=False, fontsize=9, labelcolor=INK, handlelength=1.8, columnspacing=1.5, borderaxespad=0.2,
    )  # fmt: skip


def ground() -> Any:
    """A legend's handle for the shading of held-out stretches."""
    from matplotlib.patches import Patch

    return Patch(facecolor="#e3e6ea", edgecolor="none")


def png(figure: Figure) -> bytes:
    """The figure as a PNG. Drawn once: `savefig` draws everything twice, the first time to lay it out."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    dpi = _PIXELS / figure.get_figwidth()
    figure.set_dpi(dpi)
    buffer = io.BytesIO()
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    opaque = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")  # a white ground needs no fourth channel
    few = opaque.quantize(_COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    few.save(buffer, "png", compress_level=_COMPRESSION, dpi=(dpi, dpi))
    return buffer.getvalue()
