"""Readings that are means over a window, and with them the speed of the filter's state (effects.md eq. 6a).

A mean over W is the speed half a window before, but where the acceleration changed meanwhile: there a corner is
rounded. Both are known from the currents. Scalars and indexed arrays only, as in `pieces`.
"""

import math
from typing import Any

from rw_ekf.model.state import COULOMB, MOTOR_GAIN
from rw_ekf.wheel.effect_table import EffectTable
from rw_ekf.wheel.interval import Pieces


def lateness(x: Any, table: EffectTable) -> float:
    """By how much later than the log says a command shows in the speed [s]: its delay, and half of the window."""
    late = 0.0
    if table.delay_at >= 0:
        late += max(x[table.delay_at], 0.0)
    if table.window_at >= 0:
        late += 0.5 * max(x[table.window_at], 0.0)
    return late


def rounding(x: Any, table: EffectTable, pieces: Pieces, first: int, piece: int, at_s: float, omega: float) -> float:
    """Mean over the window that ends at at_s less the speed in its middle [rad/s]; piece: the last begun by then.

    A step D of the drive at u seconds of the window W adds D min(u, W - u)^2/(2 W). The kink of dry friction at a
    reversal is left out: it would be c W/4 at most, in one reading. A wheel at rest is driven by what exceeds friction.
    """
    begins, _, currents = pieces
    window = max(x[table.window_at], 0.0)
    late = lateness(x, table) - 0.5 * window
    total = 0.0
    while piece > first:
        u = begins[piece] + late - (at_s - window)
        if u <= 0.0:
            break
        if u < window:
            before, after = x[MOTOR_GAIN] * currents[piece - 1], x[MOTOR_GAIN] * currents[piece]
            if omega == 0.0:
                before = math.copysign(max(abs(before) - x[COULOMB], 0.0), before)
                after = math.copysign(max(abs(after) - x[COULOMB], 0.0), after)
            near = min(u, window - u)
            total += (after - before) * near * near / (2.0 * window)
        piece -= 1
    return total
