"""The linear algebra of the filter for one measured component, in place: compiled in the pass, plain Python online."""

from __future__ import annotations

import math
from typing import Any

from rw_ekf.model.state import MOTOR_GAIN, SPEED, STATE_SIZE

# The widest that drift makes a parameter: the sigmas of the default prior, relative to the size of each, and a margin,
# so that a filter that has just begun is not at the ceiling.
_MARGIN = 1.25  # of the variance
_WIDEST_GAIN, _WIDEST_VISCOUS, _WIDEST_COULOMB, _WIDEST_STATIC = 0.3, 1.0, 0.5, 0.7
_SETTLED_VARIANCE = 1.0e-14  # of a hidden state [A^2 or rad^2/s^4]: a tenth of a microampere


def seed_speed(x: Any, P: Any, speed: float, variance: float) -> None:
    """Start the speed afresh from a reading; the parameters and their covariance stay."""
    x[SPEED] = speed
    P[SPEED, :] = 0.0
    P[:, SPEED] = 0.0
    P[SPEED, SPEED] = variance


def predict_covariance(P: Any, row: Any, noise: Any, work: Any, table: Any) -> None:
    """P <- F P F' + Q for F that differs from identity in its first row only (`row`); `work` (n,) is scratch.

    Without a table of effects n is a constant, for which compiled code unrolls its loops: half of what they take.
    """
    n = STATE_SIZE if table is None else row.size
    for j in range(n):
        total = row[SPEED] * P[j, SPEED]
        for m in range(1, n):
            total += row[m] * P[j, m]
        work[j] = total
    corner = row[SPEED] * work[SPEED]
    for m in range(1, n):
        corner += row[m] * work[m]
    P[SPEED, SPEED] = corner + noise[SPEED]
    for j in range(1, n):
        P[SPEED, j] = work[j]
        P[j, SPEED] = work[j]
        P[j, j] += noise[j]


def update_joseph(x: Any, P: Any, innovation: float, S: float, R: float, work: Any, table: Any) -> None:
    """Update by a measured speed: (I - K H) P (I - K H)' + K R K' for H = (1, 0, ...), symmetric; `work` (n,) is K."""
    n = STATE_SIZE if table is None else x.size  # as above
    per_S = 1.0 / S  # a division takes as long as six products
    for i in range(n):
        work[i] = P[i, SPEED] * per_S
        x[i] += work[i] * innovation
    for i in range(n - 1, -1, -1):  # downward: row and column of the speed are still the old ones when they are read
        gain = work[i]
        open_i0 = P[i, SPEED] - gain * P[SPEED, SPEED]
        noise = gain * R
        for j in range(i, -1, -1):
            value = P[i, j] - gain * P[SPEED, j] - open_i0 * work[j] + noise * work[j]
            P[i, j] = value
            P[j, i] = value


def predict_covariance_full(P: Any, F: Any, noise: Any, work: Any) -> None:
    """P <- F P F' + diag(noise), for hidden states; P, F (n, n), work (n, n) scratch."""
    n = P.shape[0]
    for i in range(n):
        for j in range(n):
            total = 0.0
            for m in range(n):
                total += F[i, m] * P[m, j]
            work[i, j] = total
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for m in range(n):
                total += work[i, m] * F[j, m]
            P[i, j] = total
            P[j, i] = total
        P[i, i] += noise[i]


def drop_settled(P: Any, hidden: int) -> None:
    """Take a hidden state that has settled for known: of a variance that is mere rounding, rounding would decide."""
    n = P.shape[0]
    for j in range(n - hidden, n):
        if P[j, j] < _SETTLED_VARIANCE:
            for m in range(n):
                P[j, m] = 0.0
                P[m, j] = 0.0


def set_ceiling(ceiling: Any, P: Any, constants: Any, effect_drift: Any) -> None:
    """Variances (n,) above which drift does not raise any: 1.25 times a wide prior's, or those of P (n, n) if larger.

    The sizes stand in the drifts, which are relative to them; effects' coefficients may wander by their own size.
    Speed and hidden states have none.
    """
    n = P.shape[0]
    for j in range(n):
        ceiling[j] = math.inf
    known = STATE_SIZE + effect_drift.size
    for j in range(MOTOR_GAIN, known):
        ceiling[j] = _MARGIN * P[j, j]
    rate = constants.relative_drift
    if rate <= 0.0:
        return
    wide = (
        _WIDEST_GAIN**2 * constants.motor_gain_drift,
        _WIDEST_VISCOUS**2 * constants.viscous_drift,
        _WIDEST_COULOMB**2 * constants.coulomb_drift,
        _WIDEST_STATIC**2 * constants.static_drift,
    )
    for j in range(MOTOR_GAIN, known):
        drift = wide[j - MOTOR_GAIN] if j < STATE_SIZE else effect_drift[j - STATE_SIZE]
        ceiling[j] = max(ceiling[j], _MARGIN * drift / rate)


def cap_variance(P: Any, ceiling: Any) -> None:
    """P <- D P D with the D = diag(d) <= 1 that brings each variance down to its ceiling; mostly it is below."""
    n = P.shape[0]
    for j in range(1, n):
        if P[j, j] > ceiling[j]:
            share = math.sqrt(ceiling[j] / P[j, j])
            for m in range(n):
                P[j, m] *= share
                P[m, j] = P[j, m]
            P[j, j] = ceiling[j]
