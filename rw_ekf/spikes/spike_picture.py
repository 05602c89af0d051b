"""Spikes over the time that a wheel was watched: how large, and how many by then."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rw_ekf.console import printable
from rw_ekf.drawing import picture
from rw_ekf.logs.picture_file import save_picture
from rw_ekf.spikes.trending import VERDICTS, WheelSpikes, verdict

_HOUR_S = 3600.0
_BLUE, _RED, _GREY = "#1f5fa8", "#c0392b", "#8a8f98"


@picture
def spikes_picture(path: str | Path, found: Sequence[WheelSpikes]) -> None:
    """Draw into a file: a column for each wheel, sizes above, trains counted below. Raises BadInputError."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(max(7.5, 5.5 * len(found)), 6.0), layout="constrained")
    panels = figure.subplots(2, len(found), sharex="col", squeeze=False)
    for wheel, (sizes, counts) in zip(found, panels.T, strict=True):
        _draw_sizes(sizes, wheel)
        _draw_counts(counts, wheel)
    save_picture(figure, path)


def _draw_sizes(axis: object, wheel: WheelSpikes) -> None:
    from matplotlib.axes import Axes

    assert isinstance(axis, Axes)
    sized = [spike for spike in wheel.spikes if spike.amplitude_mNm is not None]
    hours = [spike.watched_s / _HOUR_S for spike in sized]
    axis.vlines(hours, 0.0, [spike.amplitude_mNm or 0.0 for spike in sized], color=_BLUE, lw=1.0, alpha=0.6)
    axis.errorbar(
        hours,
        [spike.amplitude_mNm or 0.0 for spike in sized],
        yerr=[spike.std_mNm or 0.0 for spike in sized],
        fmt="o", ms=4, color=_BLUE, elinewidth=0.9,
    )  # fmt: skip
    axis.set_ylim(bottom=0.0)
    axis.set_ylabel("size of the spike [mNm]")
    axis.set_title(
        f"{printable(wheel.wheel)}: {len(wheel.spikes)} drag spikes in {wheel.watched_s / _HOUR_S:.4g} h", fontsize=10
    )
    axis.grid(visible=True, alpha=0.25)


def _draw_counts(axis: object, wheel: WheelSpikes) -> None:
    from matplotlib.axes import Axes

    assert isinstance(axis, Axes)
    end = wheel.watched_s / _HOUR_S
    trains = wheel.train_of[-1] if wheel.train_of else 0
    begins = [begin / _HOUR_S for begin in wheel.begins_s]
    hours = np.linspace(0.0, end, 100)
    expected = trains * hours / end if end > 0.0 else hours
    spread = 2.0 * np.sqrt(np.maximum(expected * (1.0 - hours / end), 0.0)) if end > 0.0 else hours
    axis.fill_between(
        hours, np.maximum(expected - spread, 0.0), expected + spread, color=_GREY, alpha=0.2, lw=0, label="2 sigma"
    )
    axis.plot(hours, expected, "--", color=_GREY, lw=1.0, label="constant incidence")
    axis.step(
        [0.0, *begins, end], [*range(trains + 1), trains], where="post", color=_RED, lw=1.6, label="trains so far"
    )
    axis.set_xlabel("time watched [h]")
    axis.set_ylabel("trains of spikes")
    if wheel.trend is not None:
        axis.set_title(f"{VERDICTS[verdict(wheel.trend)]} (p = {wheel.trend.p_value:.2g})", fontsize=10)
    axis.set_ylim(bottom=0.0)
    axis.grid(visible=True, alpha=0.25)
    axis.legend(loc="upper left", fontsize=8)
