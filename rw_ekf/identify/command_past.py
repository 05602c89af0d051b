"""What of a series of readings follows the command's past, whatever the machine's lag or delay, taken off.

A machine that settles within a few rows, or a command that acts late, leaves in the differences of readings what looks
like noise that persists. It follows the command; noise does not. The answer of a machine that turns one way is nearly
linear in the currents before: those of the last rows one by one, and means that fade over 1, 2, 4 ... 64 rows, between
which any first-order lag lies to a thousandth.
"""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course

_ROWS = 4  # one by one: a delay of so many
_FADING = 2.0 ** np.arange(7)  # rows
_DOUBLINGS = 9  # of the rows a fading mean looks back over: eight times the longest of them
_LEAST_ROWS = 20  # for each of its columns
_FED_BACK = 5.0  # sigma: beyond, the command knows the noise of the reading at which it is given


def answer_taken_off(course: Course, values: Float64Array) -> Float64Array | None:
    """Differences of readings (n,), NaN where one does not count, less what follows the command's past; None: unknown.

    None in a closed loop, where the command holds the noise of the readings
    before and would take it away with it: there a command goes with the noise of a reading that it comes after (Sims
    1972).
    """
    past = _past(course.mean_current_A)
    rows = np.flatnonzero(np.isfinite(values) & np.isfinite(course.speed_rad_s))
    rows = rows[rows < course.samples - 1]
    if rows.size < _LEAST_ROWS * (past.shape[1] + 1):
        return None
    following = np.append(course.mean_current_A[1:], 0.0)
    A = np.column_stack((past, np.sign(course.speed_rad_s)))[rows]
    found = np.linalg.lstsq(A, np.column_stack((values[rows], following[rows])), rcond=1.0e-9)[0]
    left, lead = (np.column_stack((values[rows], following[rows])) - A @ found).T
    # A command that its own past determines, as a profile's, shows nothing of a loop.
    reported = float(lead @ lead) <= 1.0e-6 * float(following[rows] @ following[rows])
    share = 0.0 if reported else float(lead @ left) / float(np.sqrt((lead @ lead) * (left @ left)) or 1.0)
    if abs(share) > _FED_BACK / np.sqrt(rows.size):
        return None
    taken: Float64Array = np.full(values.size, np.nan)
    taken[rows] = left
    return taken


def _past(current: Float64Array) -> Float64Array:
    """The mean currents (n,) of the intervals before each row, (n, columns)."""
    columns = [_earlier(current, rows) for rows in range(_ROWS)]
    for fading in np.exp(-1.0 / _FADING):
        mean = current
        for turn in range(_DOUBLINGS):  # a sum over twice as many rows each
            mean = mean + fading ** (2**turn) * _earlier(mean, 2**turn)
        columns.append((1.0 - fading) * mean)
    return np.column_stack((np.ones(current.size), *columns))


def _earlier(values: Float64Array, rows: int) -> Float64Array:
    return np.concatenate((np.full(min(rows, values.size), values[0]), values[: max(values.size - rows, 0)]))
