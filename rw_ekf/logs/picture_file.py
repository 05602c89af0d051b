"""Figures as files: PNG, SVG or PDF by suffix, all or nothing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rw_ekf.drawing import picture
from rw_ekf.errors import BadInputError
from rw_ekf.logs.atomic import atomic_path, is_special

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURE_SUFFIXES = (".png", ".svg", ".pdf")


def check_picture_suffix(path: str | Path | None) -> None:
    """Raise BadInputError unless `path` ends as a picture may: before the work, not after it. None is no picture."""
    if path is not None and Path(path).suffix.lower() not in PICTURE_SUFFIXES and not is_special(Path(path)):
        raise BadInputError(f"{path}: the name of a picture must end in {', '.join(PICTURE_SUFFIXES)}")


@picture
def save_picture(figure: Figure, path: str | Path) -> None:
    """Write a figure as its suffix says; a device such as /dev/null gets a PNG. Raises BadInputError."""
    check_picture_suffix(path)
    suffix = Path(path).suffix.lower()
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=110, format=suffix[1:] if suffix in PICTURE_SUFFIXES else "png")
