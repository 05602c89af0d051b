"""The filter's transition over one sample interval, in functions of scalars and indexed arrays (docs/filter.md).

Plain Python calls them online with numpy arrays and lists; passes over logs have them compiled as they stand.

The current is constant in pieces: a command takes force some time after the speed was read, so that an interval has
one piece, or two or more where `command_delay_s` says so.
"""

import math
from typing import Any

from rw_ekf.model.flow import flow
from rw_ekf.model.friction import FAST_STRIBECK_SPEEDS, FrictionCurve, Stribeck
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, SPEED, STATE_SIZE, STATIC, VISCOUS
from rw_ekf.wheel.interval import Pieces

_SPREAD = math.sqrt(3.0)  # of a central divided difference: 1 sigma diverged, sqrt(3) did not (docs/filter.md)
_REACH = 5.0  # standard deviations within which a kink in the transition matters
_REFLECTION, _DIFFERENCES = 5, 6  # rows of scratch behind the root


def interval(
    omega: float, k: float, curve: FrictionCurve, pieces: Pieces, start: int, stop: int, slopes: bool = True
) -> tuple[float, float, float, float, float, float]:
    """Chain the flow over pieces start..stop: speed at the end, its derivatives by omega, k, b, c, s."""
    to_omega, to_k, to_b, to_c, to_s = 1.0, 0.0, 0.0, 0.0, 0.0
    for i in range(start, stop):
        current = pieces.current_A[i]
        omega, keep, of_drive, of_b, of_c, of_s = flow(omega, k * current, curve, pieces.duration_s[i], slopes)
        to_omega *= keep
        to_k = keep * to_k + current * of_drive
        to_b = keep * to_b + of_b
        to_c = keep * to_c + of_c
        to_s = keep * to_s + of_s
    return omega, to_omega, to_k, to_b, to_c, to_s


def factor_covariance(P: Any, L: Any) -> None:
    """Lower triangular L with L L' = P (n, n), Cholesky, in the first n rows of L; no variance gives a zero column."""
    n = P.shape[0]
    for j in range(n):
        pivot = P[j, j]
        for m in range(j):
            pivot -= L[j, m] * L[j, m]
        root = math.sqrt(pivot) if pivot > 1.0e-14 * P[j, j] else 0.0
        L[j, j] = root
        for i in range(j + 1, n):
            value = P[i, j]
            for m in range(j):
                value -= L[i, m] * L[j, m]
            L[i, j] = value / root if root > 0.0 else 0.0


def reflection(x: Any, L: Any, current: float, n: int) -> float:
    """Householder's reflection I - d v v' that turns the first column of L (n, n) to where |k I| - s varies.

    v is left in row n of L, and d is returned; 0 where nothing is to be turned.
    """
    push = math.copysign(current, x[MOTOR_GAIN] * current)
    norm = 0.0
    for j in range(n):
        L[n, j] = push * L[MOTOR_GAIN, j] - L[STATIC, j]
        norm += L[n, j] * L[n, j]
    norm = math.sqrt(norm)
    # Any sign will do that does not cancel; one that rounding decides, where the first element is zero, will not.
    L[n, 0] += norm if L[n, 0] > -0.5 * norm else -norm
    length = 0.0
    for j in range(n):
        length += L[n, j] * L[n, j]
    return 2.0 / length if length > 0.0 else 0.0


def _rests_for_sure(x: Any, P: Any, pieces: Pieces, start: int, stop: int) -> bool:
    """Whether every point that a divided difference would try comes to rest within the interval and stays.

    Then the difference is exactly zero, and need not be computed: a wheel at rest far below break-away costs nothing.
    """
    longest = 0.0
    push = 0.0
    for i in range(start, stop):
        longest += pieces.duration_s[i]
        push = max(push, abs(pieces.current_A[i]))
    if not (x[MOTOR_GAIN] > 0.0 and x[VISCOUS] >= 0.0):
        return False
    # No point lies further than sqrt(3) sigma in any one parameter: the least friction against the largest drive.
    drive = push * (x[MOTOR_GAIN] + _SPREAD * math.sqrt(P[MOTOR_GAIN, MOTOR_GAIN]))
    coulomb = x[COULOMB] - _SPREAD * math.sqrt(P[COULOMB, COULOMB])
    static = x[STATIC] - _SPREAD * math.sqrt(P[STATIC, STATIC])
    fastest = abs(x[SPEED]) + _SPREAD * math.sqrt(P[SPEED, SPEED])
    drag = (_SPREAD * math.sqrt(P[VISCOUS, VISCOUS]) - x[VISCOUS]) * fastest
    brake = min(coulomb, static) - drive - max(drag, 0.0)
    return bool(fastest < brake * longest)


def divided_difference(
    x: Any, P: Any, end: float, stribeck: Stribeck, pieces: Pieces, start: int, stop: int, row: Any, L: Any
) -> float:
    """Overwrite `row` with the statistical slope of eq. 7 and return the variance of eq. 8 (see `transition`).

    `L` (7, 5) is scratch: the root, the reflection's vector v, and the differences D.
    """
    factor_covariance(P, L)
    double = reflection(x, L, pieces.current_A[stop - 1], STATE_SIZE)
    q0, q1, q2, q3, q4 = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(STATE_SIZE):
        q0 += L[SPEED, j] * L[_REFLECTION, j]
        q1 += L[MOTOR_GAIN, j] * L[_REFLECTION, j]
        q2 += L[VISCOUS, j] * L[_REFLECTION, j]
        q3 += L[COULOMB, j] * L[_REFLECTION, j]
        q4 += L[STATIC, j] * L[_REFLECTION, j]
    bends = 0.0
    along = 0.0
    for j in range(STATE_SIZE):
        turn = double * L[_REFLECTION, j]
        d0 = _SPREAD * (L[SPEED, j] - turn * q0)
        d1 = _SPREAD * (L[MOTOR_GAIN, j] - turn * q1)
        d2 = _SPREAD * (L[VISCOUS, j] - turn * q2)
        d3 = _SPREAD * (L[COULOMB, j] - turn * q3)
        d4 = _SPREAD * (L[STATIC, j] - turn * q4)
        if d0 == 0.0 and d1 == 0.0 and d2 == 0.0 and d3 == 0.0 and d4 == 0.0:
            L[_DIFFERENCES, j] = 0.0
            continue
        curve = FrictionCurve(x[VISCOUS] + d2, x[COULOMB] + d3, x[STATIC] + d4, stribeck.omega_s, stribeck.law)
        up = interval(x[SPEED] + d0, x[MOTOR_GAIN] + d1, curve, pieces, start, stop, False)[0]
        curve = FrictionCurve(x[VISCOUS] - d2, x[COULOMB] - d3, x[STATIC] - d4, stribeck.omega_s, stribeck.law)
        down = interval(x[SPEED] - d0, x[MOTOR_GAIN] - d1, curve, pieces, start, stop, False)[0]
        L[_DIFFERENCES, j] = (up - down) / (2.0 * _SPREAD)
        along += L[_DIFFERENCES, j] * L[_REFLECTION, j]
        bends += up + down - 2.0 * end
    for j in range(STATE_SIZE - 1, -1, -1):
        if L[j, j] == 0.0:
            continue
        slope = L[_DIFFERENCES, j] - double * along * L[_REFLECTION, j]
        for m in range(j + 1, STATE_SIZE):
            slope -= row[m] * L[m, j]
        row[j] = slope / L[j, j]
    return bends * bends / 12.0


def transition(
    x: Any, P: Any, stribeck: Stribeck, pieces: Pieces, start: int, stop: int, row: Any, L: Any
) -> tuple[float, float]:
    """Predict the speed over one interval: (speed [rad/s], variance of the neglected curvature [rad^2/s^2]).

    x (5,) and P (5, 5) are the present belief; `row` (5,) receives the first row of F, `L` (7, 5) is scratch.

    Away from zero speed the row is the derivative of the flow. Where the stop, the stick or the Stribeck peak lies
    within reach of the uncertainty it is the statistical slope over the columns l_j of a root of P,

        F L = D,   D_j = [Phi(x + h l_j) - Phi(x - h l_j)] / 2h,   h = sqrt(3),          (docs/filter.md eq. 7)

    because a wheel believed stuck has derivative zero, and a filter that trusts it never learns the break-away friction
    that would free it. The root is Cholesky's, turned so that its first column is the direction in which |k I| - s
    varies: motion within h sigma of what is believed is then always seen. The curvature that any linear form neglects
    is added to the process noise,

        [sum_j Phi(x + h l_j) + Phi(x - h l_j) - 2 Phi(x)]^2 / 12,                          (docs/filter.md eq. 8)

    its mean square for a bend along one direction, which the switching surface between stick and slip is.
    """
    curve = FrictionCurve(x[VISCOUS], x[COULOMB], x[STATIC], stribeck.omega_s, stribeck.law)
    end, row[SPEED], row[MOTOR_GAIN], row[VISCOUS], row[COULOMB], row[STATIC] = interval(
        x[SPEED], x[MOTOR_GAIN], curve, pieces, start, stop
    )
    nearest = min(abs(x[SPEED]), abs(end)) if x[SPEED] * end > 0.0 else 0.0
    if nearest > FAST_STRIBECK_SPEEDS * stribeck.omega_s:
        return end, 0.0
    if end == 0.0 and _rests_for_sure(x, P, pieces, start, stop):
        for j in range(STATE_SIZE):
            row[j] = 0.0
        return end, 0.0
    spread = 0.0
    for i in range(STATE_SIZE):
        for j in range(STATE_SIZE):
            spread += row[i] * P[i, j] * row[j]
    reach = _REACH * math.sqrt(max(spread, P[SPEED, SPEED]))
    if nearest > reach and reach < stribeck.omega_s:
        return end, 0.0
    return end, divided_difference(x, P, end, stribeck, pieces, start, stop, row, L)
