"""The friction torque at a moment, all effects of a model included: what the motor gives beyond what accelerates."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, by_identity
from rw_ekf.model.friction import Stribeck, acceleration
from rw_ekf.model.moment import Moment
from rw_ekf.model.state import MOTOR_GAIN, SPEED
from rw_ekf.records import Believed
from rw_ekf.wheel.dispatch import memory_flow
from rw_ekf.wheel.effect_table import ABSENT, EffectTable
from rw_ekf.wheel.pieces import driven_by, stribeck_of
from rw_ekf.wheel.transition import factor_covariance

_TURNS = 60
_MOST_GAIN = 1.0e3  # of a current over what it leaves; more is no motor
_INSTANT_S = 1.0e-7  # over which a friction with a memory is followed


@by_identity
class FrictionTorque(NamedTuple):
    """Friction per unit inertia [rad/s^2] at a moment; above zero it slows a wheel that turns forward.

    It is k I less the acceleration, with I the current in the winding after the effects that change it: torques from
    outside count as friction, and at rest it is the drive that is held. x (n,), P (n, n): belief. at: the current in
    force [A], temperature [degC], angle [rad], time [s] and columns. Its sigma is that of the states: a shape that was
    fitted (where a bump is, and how wide) is taken for known.
    """

    x: Float64Array
    P: Float64Array
    table: EffectTable
    stribeck: Stribeck
    at: Moment

    def value_rad_s2(self, speed_rad_s: float | None = None) -> float:
        """At the believed speed, or at another one; hidden states stay."""
        values = self.x.tolist()
        if speed_rad_s is not None:
            values[SPEED] = speed_rad_s
        return friction_of(values, self.table, self.stribeck, self.at)

    def believed_rad_s2(self, speed_rad_s: float | None = None) -> Believed:
        """The same with its standard deviation, by divided differences (docs/filter.md eq. 7).

        speed_rad_s: a speed to take for known in place of the believed one.
        """
        x, spread = self.x, self.P
        if speed_rad_s is not None:
            x, spread = x.copy(), spread.copy()
            x[SPEED], spread[SPEED, :], spread[:, SPEED] = speed_rad_s, 0.0, 0.0
        root = np.zeros_like(spread)
        factor_covariance(spread, root)

        def friction(state: Float64Array) -> float:
            return friction_of(state.tolist(), self.table, self.stribeck, self.at)

        differences = [friction(x + step) - friction(x - step) for step in math.sqrt(3.0) * root.T]
        return Believed(friction(x), math.hypot(*differences) / math.sqrt(12.0))


def current_for(
    x: Float64Array,
    table: EffectTable,
    stribeck: Stribeck,
    at: Moment,
    drive_rad_s2: float,
) -> float:
    """The current [A] whose drive k I, after a dead zone, saturation and the gain's temperature, is drive_rad_s2.

    By fixed point, which contracts while less than half of the current is lost; a lag and a delay are not undone. at:
    as in `FrictionTorque`. Raises ZeroDivisionError for a motor gain of zero.
    """
    values = x.tolist()
    needed: float = drive_rad_s2 / values[MOTOR_GAIN]
    moment = at._replace(omega=values[SPEED])
    current: float = needed
    for _ in range(_TURNS):
        terms, _, _ = driven_by(values, table, stribeck_of(values, table, stribeck), moment._replace(current=current))
        before, current = current, needed - terms.amperes
        if not abs(current) <= _MOST_GAIN * abs(needed):
            return needed
        if abs(current - before) <= 1.0e-12:
            break
    return current


def friction_of(values: Any, table: EffectTable, stribeck: Stribeck, moment: Moment) -> float:
    """Friction per unit inertia [rad/s^2] at the speed of a belief; values (n,): numbers that divide as Python's do."""
    speed, gain = values[SPEED], values[MOTOR_GAIN]
    current = moment.current if table.lag_state_at == ABSENT else values[table.lag_state_at]
    now = moment._replace(omega=speed, current=current)
    terms, drive, curve = driven_by(values, table, stribeck_of(values, table, stribeck), now)
    if table.memory_at == ABSENT:
        rate = acceleration(speed, drive, *curve)
    else:
        memory, coefficient = values[table.memory_state_at], values[table.memory_at]
        moved, _ = memory_flow(
            table.memory_code, speed, memory, drive, curve, coefficient, table.memory_shape, _INSTANT_S
        )
        rate = (moved - speed) / _INSTANT_S
    return float(gain * (current + terms.amperes) - rate)
