"""What a column of directions says: +1 and -1, however it is written."""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.errors import LogError
from rw_ekf.logs.raw_table import RawTable

_FORWARD = frozenset({
    "+", "+1", "1", "cw", "f", "fwd", "forward", "forwards", "pos", "positive", "right", "r", "rechts", "vor",
    "vorwaerts", "vorwärts", "true", "up", "avant", "horaire",
})  # fmt: skip
_BACKWARD = frozenset({
    "-", "-1", "0", "ccw", "b", "back", "backward", "backwards", "rev", "reverse", "neg", "negative", "left", "l",
    "links", "zurueck", "rückwärts", "false", "down", "arriere", "antihoraire",
})  # fmt: skip


def signs_of(table: RawTable, index: int) -> Float64Array:
    """Signs (n,) of a column: of its numbers (of two that are not negative, the lower is -1), or of its words.

    Raises LogError for what is neither.
    """
    if not table.is_text(index):
        values = table.floats(index)
        known = np.unique(values[np.isfinite(values)])
        if known.size == 2 and known[0] >= 0.0:
            return np.where(np.isnan(values), np.nan, np.where(values == known[1], 1.0, -1.0))
        return np.asarray(np.sign(values))
    words = [None if value is None else str(value).strip().lower() for value in table.columns[index].to_pylist()]
    signs = {word: 1.0 if word in _FORWARD else -1.0 for word in set(words) if word in _FORWARD | _BACKWARD}
    odd = next((word for word in words if word and word not in signs), None)
    if odd is not None:
        raise LogError(
            f"{table.path}: column '{table.names[index]}' is to be a direction and says {odd!r}: "
            "forward or reverse, CW or CCW, 1 or -1"
        )
    return np.array([np.nan if not word else signs[word] for word in words])
