"""The friction torque at a moment, all effects of a model included: what the motor gives beyond what accelerates."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, by_identity
from rw_ekf.model.considered import Off
from rw_ekf.model.effect import Term
from rw_ekf.model.friction import Stribeck, acceleration
from rw_ekf.model.moment import Moment
from rw_ekf.model.state import MOTOR_GAIN, SPEED
from rw_ekf.records import Believed
from rw_ekf.wheel.dispatch import memory_flow
from rw_ekf.wheel.effect_table import ABSENT, NO_EFFECTS, EffectSet, EffectTable
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
    force [A], temperature [degC], angle [rad], time [s] and columns. Its sigma is that of the states, which are
    learned, and of what is considered: shapes and curves that a fit left open.
    """

    x: Float64Array
    P: Float64Array
    table: EffectTable
    stribeck: Stribeck
    at: Moment
    effects: EffectSet = NO_EFFECTS
    began: Float64Array = np.zeros((0, 0))  # (n, n) with which the filter began, where effects have what is considered

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
            x, spread = x.copy(), _of_known_speed(spread)
            x[SPEED] = speed_rad_s

        def friction(state: Float64Array) -> float:
            return friction_of(state.tolist(), self.table, self.stribeck, self.at)

        variance = _variance(friction, x, spread)
        ways = displacements(self.effects, x.size)
        if ways:
            now = variance if speed_rad_s is not None else _variance(friction, x, _of_known_speed(spread))
            followed, considered = self._considered(friction, x, ways)
            began = _variance(friction, x, _of_known_speed(self.began))
            by_speed = max(variance - now, 0.0)
            variance = by_speed + variance_of_known_shapes(now, began, followed) + considered
        return Believed(friction(x), math.sqrt(variance))

    def _considered(
        self, friction: Callable[[Float64Array], float], x: Float64Array, ways: Sequence[Displacement]
    ) -> tuple[float, float]:
        """Variances: of what the learned numbers do as shapes are off, and of that with the shapes themselves."""
        followed = considered = 0.0
        for off in ways:
            ahead = friction_of((x + off.numbers).tolist(), off.ahead, self.stribeck, self.at)
            behind = friction_of((x - off.numbers).tolist(), off.behind, self.stribeck, self.at)
            considered += (0.5 * (ahead - behind) * off.scale) ** 2
            followed += (0.5 * (friction(x + off.numbers) - friction(x - off.numbers)) * off.scale) ** 2
        return followed, considered


def _variance(friction: Callable[[Float64Array], float], x: Float64Array, spread: Float64Array) -> float:
    """Of the friction over a belief, by divided differences (docs/filter.md eq. 7)."""
    root = np.zeros_like(spread)
    factor_covariance(spread, root)
    differences = [friction(x + step) - friction(x - step) for step in math.sqrt(3.0) * root.T]
    return math.fsum(step * step for step in differences) / 12.0


def _of_known_speed(spread: Float64Array) -> Float64Array:
    known = spread.copy()
    known[SPEED, :] = known[:, SPEED] = 0.0
    return known


def variance_of_known_shapes(now: float, began: float, followed: float) -> float:
    """The variance that a filter would have by now had it begun with the shapes known (docs/filter.md eq. 7b).

    It began with what shapes make of the numbers in its variance, `followed`, and has learned since: information adds
    up. Of a number that drifts, and is known worse than at first, what the shapes make of it is in the variance still.
    """
    known = began - followed
    if not (now > 0.0 and known > 0.0):
        return 0.0
    return 1.0 / (1.0 / known + 1.0 / now - 1.0 / began) if now < began else now - followed


@by_identity
class Displacement(NamedTuple):
    """A direction of what is considered, as friction is looked at to either side of it."""

    numbers: Float64Array  # (n,) what the state does
    ahead: EffectTable
    behind: EffectTable
    scale: float  # standard deviations for each of what is looked at: 1, or more where a shape allows no whole one


@functools.lru_cache(maxsize=32)
def displacements(effects: EffectSet, size: int) -> tuple[Displacement, ...]:
    """The directions of effects as tables, for states of so many numbers."""
    found = []
    for direction in effects.considered:
        part = min((_allowed(term, off) for term, off in zip(effects.terms, direction.terms, strict=True)), default=1.0)
        numbers = np.zeros(size)
        numbers[MOTOR_GAIN : MOTOR_GAIN + len(direction.numbers)] = np.array(direction.numbers) * part
        ahead, behind = effects.off_by(direction, part).table(), effects.off_by(direction, -part).table()
        found.append(Displacement(numbers, ahead, behind, 1.0 / part))
    return tuple(found)


def _allowed(term: Term, off: Off) -> float:
    """As much of a direction, 1 at the most, as a slope of each shape constant carries."""
    return min(
        (
            min(1.0, constant.reach_at(value) / abs(by))
            for constant, value, by in zip(term.effect.constants, term.shape, off.shape, strict=False)
            if by != 0.0
        ),
        default=1.0,
    )


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
