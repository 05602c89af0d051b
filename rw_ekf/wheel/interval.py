"""What lies between two readings: pieces of constant current, and the conditions around them."""

from __future__ import annotations

from typing import Any, NamedTuple


class Pieces(NamedTuple):
    """Pieces of constant current in order of time; arrays over a log, lists over what the online filter remembers."""

    begin_s: Any  # (m,)
    duration_s: Any  # (m,)
    current_A: Any  # (m,)
