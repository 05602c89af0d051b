"""Compensations beside the estimator in memory of a fixed size: DMC, and predictive crossing by the model alone.

Bit by bit `DynamicModelCompensation` and `PredictiveCrossing(rate_hz)` (tests/flight). What stands between a
compensation and a wheel, trust, bound and guard, is the caller's (docs/compensation-on-the-wheel.md).
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, by_identity
from rw_ekf.control.compensation.known import signed_friction, speed_against
from rw_ekf.control.compensation.predictive_crossing import (
    Payback,
    guess,
    inverted,
    is_taken_to_stand,
    owed_after,
    paid,
)
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.flight.onboard import (
    ANGLE_RAD,
    BROKEN,
    COLUMN,
    DELAY_S,
    IN_FORCE_A,
    PIECES_MOST,
    PREDICTED_RAD_S,
    TEMPERATURE_DEGC,
    USED,
    Onboard,
    lay_pieces,
    sigma,
)
from rw_ekf.model.flow import flow
from rw_ekf.model.friction import FrictionCurve
from rw_ekf.model.moment import Moment
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, SPEED, STATIC, VISCOUS, FrictionParameters
from rw_ekf.wheel.effect_table import EffectTable
from rw_ekf.wheel.interval import Interval, Pieces
from rw_ekf.wheel.momentary_friction import current_for, friction_of
from rw_ekf.wheel.pieces import effect_interval

# Places in `Crossing.now`.
_PROMISED_RAD_S = 0  # speed where the next command acts, if the request is met
_PROMISES = 1  # 1 where there is one
_OWED_RAD_S = 2
_STOOD = 3
_BEGIN_RAD_S = 4  # speed where the command acts
_BEGIN_S = 5  # when that is
_ANGLE_RAD = 6  # and the angle there
_NOW = 7

_PAYBACK = Payback()


@by_identity
class Crossing(NamedTuple):
    """What predictive crossing remembers, and room to look ahead in."""

    now: Any  # (7,)
    x: Float64Array  # (n,) the belief where the command acts
    end: Float64Array  # (n,)
    row: Float64Array  # (n,)
    pieces: Pieces


def crossing_of(held: Onboard) -> Crossing:
    """Begin."""
    n = held.x.size
    pieces = Pieces(np.zeros(PIECES_MOST), np.zeros(PIECES_MOST), np.zeros(PIECES_MOST))
    return Crossing(np.zeros(_NOW), np.zeros(n), np.zeros(n), np.zeros(n), pieces)


def current_by_dmc(
    held: Onboard, constants: FilterConstants, table: EffectTable | None, request_rad_s2: float, relative: bool
) -> float:
    """The current [A] for an acceleration, friction and effects compensated: `DynamicModelCompensation`.

    0 where that is no number: without a motor gain there is no current.
    """
    x = held.x
    speed = x[SPEED]
    friction = 0.0
    at = speed_against(request_rad_s2, speed)
    requested = speed != 0.0 or request_rad_s2 != 0.0
    if table is None:
        stribeck = constants.stribeck
        if requested:
            friction = signed_friction(at, x[VISCOUS], x[COULOMB], x[STATIC], stribeck.omega_s, stribeck.law)
        current = (request_rad_s2 + friction) / x[MOTOR_GAIN]
    else:
        now = held.now
        columns = (now[COLUMN], now[COLUMN + 1], now[COLUMN + 2])
        time_s = 0.0 if relative else float(held.last_s[USED])
        moment = Moment(0.0, now[IN_FORCE_A], now[TEMPERATURE_DEGC], now[ANGLE_RAD], time_s, 0.0, columns)
        if requested:
            x[SPEED] = at
            friction = friction_of(x, table, constants.stribeck, moment)
            x[SPEED] = speed
        current = current_for(x, table, constants.stribeck, moment, request_rad_s2 + friction)
    return float(current) if math.isfinite(current) else 0.0


def current_by_crossing(
    crossing: Crossing, held: Onboard, constants: FilterConstants, table: EffectTable | None,
    request_rad_s2: float, period_s: float, relative: bool,
) -> float:  # fmt: skip
    """The current [A] with which the wheel ends the next period with the momentum requested: `PredictiveCrossing`.

    Once after every reading. 0 while the motor gain is believed not to be positive.
    """
    now, x, stribeck = crossing.now, held.x, constants.stribeck
    if held.counts[BROKEN] == 1:
        now[_PROMISES] = 0.0
        now[_OWED_RAD_S] = 0.0
    gain = x[MOTOR_GAIN]
    if not gain > 0.0:
        now[_PROMISES] = 0.0
        return 0.0
    wanted = request_rad_s2 * period_s
    spread = sigma(held, SPEED)
    rests = is_taken_to_stand(x[SPEED], spread, held.now[PREDICTED_RAD_S], now[_OWED_RAD_S] + wanted, _PAYBACK)
    _look_ahead(crossing, held, constants, table, 0.0 if rests else x[SPEED], relative)
    begin = now[_BEGIN_RAD_S]
    if rests and now[_STOOD] == 0.0:
        now[_PROMISES] = 0.0  # what the belief was off is not owed
    now[_STOOD] = 1.0 if rests else 0.0
    if now[_PROMISES] == 1.0:
        now[_OWED_RAD_S] = owed_after(now[_OWED_RAD_S], now[_PROMISED_RAD_S], begin, period_s, _PAYBACK)
    now[_PROMISED_RAD_S] = begin + wanted
    now[_PROMISES] = 1.0
    target = begin + wanted + paid(now[_OWED_RAD_S], wanted, begin, spread, _PAYBACK)
    if begin == 0.0 and target == 0.0:
        return 0.0
    parameters = FrictionParameters(gain, x[VISCOUS], x[COULOMB], x[STATIC])
    tried = guess(begin, target, period_s, parameters, stribeck)
    end = partial(_end, crossing, held, constants, table, period_s)
    current = inverted(end, target, tried, gain * period_s)
    return float(current) if math.isfinite(current) else 0.0


def _look_ahead(
    crossing: Crossing, held: Onboard, constants: FilterConstants, table: EffectTable | None, speed: float,
    relative: bool,
) -> None:  # fmt: skip
    """The belief, at a speed, where a command acts that is as late as the last one was; `WheelOutlook`."""
    x, now, pieces, stribeck = crossing.x, crossing.now, crossing.pieces, constants.stribeck
    for j in range(x.size):
        x[j] = held.x[j]
    x[SPEED] = speed
    last = held.last_s[USED]
    epoch = last if relative else 0.0
    to_s = last + held.now[DELAY_S]
    count, _ = lay_pieces(held, pieces, to_s, epoch)
    if table is None:
        curve = FrictionCurve(x[VISCOUS], x[COULOMB], x[STATIC], stribeck.omega_s, stribeck.law)
        for piece in range(0, count):
            drive = x[MOTOR_GAIN] * pieces.current_A[piece]
            x[SPEED] = flow(x[SPEED], drive, curve, pieces.duration_s[piece], False)[0]
    else:
        given = held.now
        columns = (given[COLUMN], given[COLUMN + 1], given[COLUMN + 2])
        from_s = float(last - epoch)
        until = float(to_s - epoch)
        interval = Interval(from_s, until, given[TEMPERATURE_DEGC], given[ANGLE_RAD], 0, 0, count, columns)
        if until > from_s:
            effect_interval(x, table, stribeck, pieces, interval, False, crossing.row, crossing.end)
            x[SPEED] = crossing.end[SPEED]
        now[_ANGLE_RAD] = given[ANGLE_RAD] + 0.5 * (speed + x[SPEED]) * (until - from_s)
        now[_BEGIN_S] = until
    now[_BEGIN_RAD_S] = x[SPEED]


def _end(
    crossing: Crossing, held: Onboard, constants: FilterConstants, table: EffectTable | None, period_s: float,
    current_A: float,
) -> float:  # fmt: skip
    """The speed [rad/s] after a current has acted for a period."""
    x, stribeck = crossing.x, constants.stribeck
    if table is None:
        curve = FrictionCurve(x[VISCOUS], x[COULOMB], x[STATIC], stribeck.omega_s, stribeck.law)
        return flow(x[SPEED], x[MOTOR_GAIN] * current_A, curve, period_s, False)[0]
    given, begin_s = held.now, crossing.now[_BEGIN_S]
    pieces = crossing.pieces
    pieces.begin_s[0] = begin_s
    pieces.duration_s[0] = period_s
    pieces.current_A[0] = current_A
    columns = (given[COLUMN], given[COLUMN + 1], given[COLUMN + 2])
    interval = Interval(
        begin_s, begin_s + period_s, given[TEMPERATURE_DEGC], crossing.now[_ANGLE_RAD], 0, 0, 1, columns
    )
    effect_interval(x, table, stribeck, pieces, interval, False, crossing.row, crossing.end)
    return float(crossing.end[SPEED])
