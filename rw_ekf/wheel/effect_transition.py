"""The filter's transition where the model has effects: coefficients and hidden states are states like the others.

The rule is that of `transition` (docs/filter.md eq. 6-8): the derivative of the flow away from zero speed, the
statistical slope over a turned root of the covariance near it; and always the latter where an effect has a hidden
state, a delay, a window or a Stribeck shape, whose derivatives are not written out.
"""

import math
from typing import Any

from rw_ekf.model.friction import FAST_STRIBECK_SPEEDS, Stribeck
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, SPEED
from rw_ekf.wheel.effect_table import EffectTable
from rw_ekf.wheel.interval import Interval, Pieces
from rw_ekf.wheel.pieces import effect_interval
from rw_ekf.wheel.transition import _REACH, _SPREAD, factor_covariance, reflection
from rw_ekf.wheel.window import lateness


def turn_root(x: Any, L: Any, current: float, n: int) -> None:
    """Turn the root L (n, n) so that its first column is the direction in which |k I| - s varies (filter.md eq. 7).

    Rows n and n + 1 of L are scratch. The turned root is left in rows n + 2 onwards.
    """
    double = reflection(x, L, current, n)
    for i in range(n):
        dot = 0.0
        for j in range(n):
            dot += L[i, j] * L[n, j]
        for j in range(n):
            L[n + 2 + i, j] = L[i, j] - double * L[n, j] * dot
    L[n + 1, 0] = double


def solve_slopes(L: Any, differences: Any, row: Any, n: int) -> None:
    """Row (n,) with row L = differences, L lower triangular before its turn; a column without variance is left out."""
    double = L[n + 1, 0]
    along = 0.0
    for j in range(n):
        along += differences[j] * L[n, j]
    for j in range(n - 1, -1, -1):
        row[j] = 0.0
        if L[j, j] == 0.0:
            continue
        slope = differences[j] - double * along * L[n, j]
        for m in range(j + 1, n):
            slope -= row[m] * L[m, j]
        row[j] = slope / L[j, j]


def effect_transition(
    x: Any, P: Any, table: EffectTable, stribeck: Stribeck, pieces: Pieces, interval: Interval, F: Any, work: Any
) -> float:
    """Predict x (n,) over one interval in place; F (n, n) gets the rows of speed and hidden states.

    Returns the variance of the neglected curvature of the speed [rad^2/s^2]; those of the hidden states' are left in
    work[n + 1, 1:]. A friction that jumps as a wheel breaks away would else be as good as known once the speed is:
    break-away friction was 145 of its sigmas off. work (3 n + 6, n) is scratch: the root and its turn, then points,
    ends and differences.
    """
    n = table.size
    hidden = table.hidden
    analytic = hidden == 0 and table.delay_at < 0 and table.window_at < 0 and table.stribeck_at < 0
    end = work[3 * n + 2]
    row = F[SPEED]
    effect_interval(x, table, stribeck, pieces, interval, analytic, row, end)
    nearest = min(abs(x[SPEED]), abs(end[SPEED])) if x[SPEED] * end[SPEED] > 0.0 else 0.0
    needed = True
    if analytic:
        if nearest > FAST_STRIBECK_SPEEDS * stribeck.omega_s:
            needed = False
        else:
            spread = 0.0
            for i in range(n):
                for j in range(n):
                    spread += row[i] * P[i, j] * row[j]
            reach = _REACH * math.sqrt(max(spread, P[SPEED, SPEED]))
            needed = not (nearest > reach and reach < stribeck.omega_s)
    bends = 0.0
    if needed:  # always where there are hidden states
        bends = _differences(x, P, table, stribeck, pieces, interval, end, F, work)
    is_near = nearest <= FAST_STRIBECK_SPEEDS * stribeck.omega_s
    for m in range(hidden):
        work[n + 1, 1 + m] = work[n + 1, 1 + m] * work[n + 1, 1 + m] / 12.0 if is_near else 0.0
    x[SPEED] = end[SPEED]
    for j in range(n - hidden, n):
        x[j] = end[j]
    return bends * bends / 12.0 if is_near else 0.0


def _differences(
    x: Any, P: Any, table: EffectTable, stribeck: Stribeck, pieces: Pieces, interval: Interval, middle: Any,
    F: Any, work: Any,
) -> float:  # fmt: skip
    """Central divided differences of speed and hidden states over the columns of the turned root; the speed's bends.

    middle (n,): where the interval leads from x. The bends of hidden states are left in work[n + 1, 1:].
    """
    n = table.size
    hidden = table.hidden
    factor_covariance(P, work)
    turn_root(x, work, pieces.current_A[interval.stop - 1], n)
    end, point, up = work[3 * n + 3], work[3 * n + 4], work[3 * n + 5]
    bends = 0.0
    for m in range(hidden):
        work[n + 1, 1 + m] = 0.0
    for j in range(n):
        differs = False
        for i in range(n):
            d = _SPREAD * work[n + 2 + i, j]
            point[i] = x[i] + d
            up[i] = x[i] - d
            differs = differs or d != 0.0
        for m in range(hidden + 1):
            work[2 * n + 2 + m, j] = 0.0
        if not differs:
            continue
        effect_interval(point, table, stribeck, pieces, interval, False, F[SPEED], end)
        for i in range(n):
            point[i], up[i] = up[i], end[i]
        effect_interval(point, table, stribeck, pieces, interval, False, F[SPEED], end)
        work[2 * n + 2, j] = (up[SPEED] - end[SPEED]) / (2.0 * _SPREAD)
        bends += up[SPEED] + end[SPEED] - 2.0 * middle[SPEED]
        for m in range(hidden):
            at = n - hidden + m
            work[n + 1, 1 + m] += up[at] + end[at] - 2.0 * middle[at]
            work[2 * n + 3 + m, j] = (up[at] - end[at]) / (2.0 * _SPREAD)
    solve_slopes(work, work[2 * n + 2], F[SPEED], n)
    for m in range(hidden):
        solve_slopes(work, work[2 * n + 3 + m], F[n - hidden + m], n)
    return bends


def seed_hidden(x: Any, P: Any, table: EffectTable, current: float, omega_s: float) -> None:
    """Start the hidden states where the speed starts afresh: a settled current, and settled friction if it turns."""
    n = table.size
    for j in range(n - table.hidden, n):
        for m in range(n):
            P[j, m] = 0.0
            P[m, j] = 0.0
    if table.lag_state_at >= 0:
        x[table.lag_state_at] = current
    if table.memory_state_at >= 0:
        x[table.memory_state_at] = math.copysign(x[COULOMB], x[SPEED]) if abs(x[SPEED]) > omega_s else 0.0
        spread = 0.3 * x[COULOMB]
        P[table.memory_state_at, table.memory_state_at] = spread * spread


def open_past(x: Any, P: Any, table: EffectTable, current: float) -> None:
    """Let what flowed before the first command that is known be anything as large: a lag or a delay remembers it.

    A wheel at rest that is commanded for the first time had no current before: a lag's current is that much in doubt,
    and the speed what a delay still brings of another.
    """
    late = x[MOTOR_GAIN] * current * lateness(x, table)
    P[SPEED, SPEED] += late * late
    if table.lag_state_at >= 0:
        P[table.lag_state_at, table.lag_state_at] += current * current
