"""What a verb does with a picture that cannot be drawn: one sentence, and everything else as if it had been."""

from __future__ import annotations

import sys
from collections.abc import Callable

from rw_ekf.errors import PictureError


def drawn(draw: Callable[[], object]) -> bool:
    """Draw; False where that failed, which is then said on standard error."""
    try:
        draw()
    except PictureError as error:
        sys.stderr.write(f"rw-ekf: error: {error}; all else is as it should be\n")
        return False
    return True
