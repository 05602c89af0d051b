"""The pictures of a page, each written as it is drawn, and what is reported of those that cannot be."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from rw_ekf.errors import BadInputError, PictureError
from rw_ekf.logs.atomic import atomic_path


def write_pictures(
    directory: Path, draws: Mapping[str, Callable[[], bytes | None]]
) -> tuple[dict[str, bytes], PictureError | None]:
    """Draw and write each file; returns those that there are, by their names, and one sentence for all that failed.

    What an earlier run left under the name of a picture that there is not (None), or that failed, is removed.
    Raises BadInputError if the place cannot be written.
    """
    pictures, reasons = {}, {}
    for name, draw in draws.items():
        content = None
        try:
            content = draw()
        except PictureError as error:
            reasons[name] = str(error)
        if content is None:
            remove(directory / name)
            continue
        with atomic_path(directory / name) as temporary:
            temporary.write_bytes(content)
        pictures[name] = content
    if not reasons:
        return pictures, None
    return pictures, PictureError(f"{', '.join(reasons)}: {'; '.join(dict.fromkeys(reasons.values()))}")


def remove(path: Path) -> None:
    """Remove what an earlier run left. Raises BadInputError if it stays."""
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise BadInputError(
            f"{path}: is left from another run and cannot be removed ({error.strerror or error}): remove it"
        ) from None
