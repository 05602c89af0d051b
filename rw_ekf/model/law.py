"""A law without a formula: a function of one quantity, by its values on even knots (docs/effects.md, "Learned laws").

Between knots it is straight, and beyond them it stays as it was at the last: what was not seen is not made up. A law
may have several functions, one for each coefficient of its term; it is their sum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args

from rw_ekf.model.moment import Moment

if TYPE_CHECKING:
    from rw_ekf.arrays import Float64Array

Quantity = Literal[
    "speed", "speed_size", "angle", "current_along_motion", "current_size", "temperature", "time", "column"
]
ActsAs = Literal["drag", "torque", "viscous_drag", "windage", "motor_gain", "current_loss"]

QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)
KINDS: tuple[ActsAs, ...] = get_args(ActsAs)
OF_SPEED: tuple[Quantity, ...] = ("speed", "speed_size")
MOST_COLUMNS = 3  # of a log that laws of one model may be functions of
UNITS = {
    "speed": "rad/s", "speed_size": "rad/s", "angle": "rad", "current_along_motion": "A", "current_size": "A",
    "temperature": "degC", "time": "s",
}  # fmt: skip
KIND_UNITS = {
    "drag": "rad/s^2",
    "torque": "rad/s^2",
    "viscous_drag": "1/s",
    "windage": "1/rad",
    "motor_gain": "1",
    "current_loss": "A",
}

_SPEED, _SPEED_SIZE, _ANGLE, _CURRENT_ALONG, _CURRENT_SIZE, _TEMPERATURE, _TIME, _COLUMN = range(len(QUANTITIES))
DRAG, _TORQUE, _VISCOUS, _WINDAGE, _GAIN, LOSS = range(len(KINDS))
FORMULA = -1  # in the place of a quantity: the values are a program (formula_program)
TURN = 2.0 * math.pi
_POINT = 1.0e-3  # rad: over less a mean is the value


@dataclass(frozen=True)
class Law:
    """What a law is a function of, how it acts, and its functions by their values on even knots."""

    quantity: Quantity
    acts_as: ActsAs
    first: float  # the first knot, in the quantity's unit
    last: float
    functions: tuple[tuple[float, ...], ...]  # (m, knots), in the unit of `acts_as` for coefficients of 1
    prior_std: tuple[float, ...] = ()  # (m,) of the coefficients about 0, where they are found; () where they are known
    column: str = ""  # the log's, of a law of one
    slot: int = 0  # which of the model's columns that is
    spread: tuple[float, ...] = ()  # (knots,) standard deviation of the sum, where it was found; () meanwhile

    @property
    def knots(self) -> Float64Array:
        """Where its functions have their values, (knots,)."""
        import numpy as np  # here: the catalogue is read by programs that reckon nothing

        return np.linspace(self.first, self.last, len(self.functions[0]))

    @property
    def over(self) -> int:
        """The quantity's code in a table; a column's slot is in it."""
        return QUANTITIES.index(self.quantity) + (self.slot if self.quantity == "column" else 0)

    @property
    def name(self) -> str:
        """The quantity as a person calls it: a column by its own name."""
        return self.column if self.quantity == "column" else self.quantity

    @property
    def unit(self) -> str:
        """Of the quantity; a column's is not known."""
        return UNITS.get(self.quantity, "")

    @property
    def own_unit(self) -> str:
        """Of the law."""
        return KIND_UNITS[self.acts_as]

    @property
    def number(self) -> float:
        """One number for what it is of and how it acts: a model has one law of each."""
        return float(1 + KINDS.index(self.acts_as) + len(KINDS) * self.over)

    def held(self, end: int) -> Law:
        """A law of time as it was at the begin (0) or the end (-1) of the record it was found in, for good."""
        return replace(self, functions=tuple((values[end], values[end]) for values in self.functions), spread=())

    def values(self, coefficients: Any) -> Float64Array:
        """The law on its knots for coefficients (m,)."""
        import numpy as np

        values: Float64Array = np.asarray(coefficients, dtype=np.float64) @ np.array(self.functions)
        return values

    def std(self, covariance: Any) -> Float64Array:
        """Its standard deviation on its knots from the covariance (m, m) of the coefficients."""
        import numpy as np

        functions = np.array(self.functions)
        variance = np.einsum("ik,ij,jk->k", functions, np.asarray(covariance), functions)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def sums_of(functions: Float64Array) -> Float64Array:
    """Integrals from the first knot to each, in knots, of straight pieces; (knots,)."""
    import numpy as np

    return np.concatenate(([0.0], np.cumsum(0.5 * (functions[1:] + functions[:-1]))))


class Place(NamedTuple):
    """Where all functions of one law are looked at: between two knots, or along an arc of the angle."""

    knot: int  # -1: the quantity is not known
    share: float  # of the way from it to the next
    per: float  # knots per rad/s, by which the place moves with the speed
    to_knot: int  # of an arc: where it ends
    to_share: float
    turns: float  # of an arc: whole turns from the begin of its first to the begin of its last
    scale: float  # of an arc: 1/knots; 0 for a point


def motion(omega: float, current: float) -> float:
    """1.0 or -1.0, the way the wheel turns; at rest that of its current, as it would move."""
    return 1.0 if omega > 0.0 or (omega == 0.0 and current > 0.0) else -1.0


def point(count: int, first: float, per: float, at: float, by_speed: float) -> Place:
    """A value of the quantity among `count` even knots; per: knots per unit; by_speed: its slope by the speed."""
    place = (at - first) * per
    if not place > 0.0:
        return Place(0, 0.0, 0.0, 0, 0.0, 0.0, 0.0)
    if place >= count - 1:
        return Place(count - 2, 1.0, 0.0, 0, 0.0, 0.0, 0.0)
    knot = int(place)
    return Place(knot, place - knot, per * by_speed, 0, 0.0, 0.0, 0.0)


def arc(count: int, angle: float, turned: float) -> Place:
    """The angle [rad] turned from `angle`; one turn has all knots."""
    if abs(turned) < _POINT:
        middle = (angle + 0.5 * turned) / TURN
        return point(count, 0.0, float(count - 1), middle - math.floor(middle), 0.0)
    begun, ended = math.floor(angle / TURN), math.floor((angle + turned) / TURN)
    begin, end = (angle / TURN - begun) * (count - 1), ((angle + turned) / TURN - ended) * (count - 1)
    knot, to_knot = min(int(begin), count - 2), min(int(end), count - 2)
    scale = TURN / ((count - 1) * turned)
    return Place(knot, begin - knot, 0.0, to_knot, end - to_knot, float(ended - begun), scale)


def law_place(count: int, first: float, per: float, over: int, now: Moment) -> Place:
    """Where a law of the quantity `over` is looked at in a piece (`StaticEffect` says what a piece is).

    A law of the signed speed, on an even number of knots about zero, jumps there: what differs by direction does so at
    any speed.
    """
    if over == _ANGLE:
        return arc(count, now.angle, now.omega * now.duration)
    at, by_speed = now.omega, 0.0
    if over == _SPEED:
        by_speed = 1.0
    elif over == _SPEED_SIZE:
        at, by_speed = abs(now.omega), motion(now.omega, now.current)
    elif over == _CURRENT_ALONG:
        at = now.current * motion(now.omega, now.current)
    elif over == _CURRENT_SIZE:
        at = abs(now.current)
    elif over == _TEMPERATURE:
        at = now.temperature
    elif over == _TIME:
        at = now.time
    elif over >= _COLUMN:
        at = now.columns[over - _COLUMN]
    if math.isnan(at):  # a column that was not logged
        return Place(-1, 0.0, 0.0, 0, 0.0, 0.0, 0.0)
    found = point(count, first, per, at, by_speed)
    if over == _SPEED and first < 0.0 and 2 * (found.knot + 1) == count:
        return Place(found.knot, 0.5 + 0.5 * motion(now.omega, now.current), 0.0, 0, 0.0, 0.0, 0.0)
    return found


def law_value(values: Any, sums: Any, start: int, count: int, place: Place) -> tuple[float, float]:
    """The function whose knots are values[start:start + count], and its slope by the speed; over an arc its mean."""
    if place.knot < 0:
        return 0.0, 0.0
    at = start + place.knot
    rise = values[at + 1] - values[at]
    if place.scale == 0.0:
        return values[at] + place.share * rise, rise * place.per
    to = start + place.to_knot
    within = sums[to] + place.to_share * (values[to] + 0.5 * place.to_share * (values[to + 1] - values[to]))
    within -= sums[at] + place.share * (values[at] + 0.5 * place.share * rise)
    return (place.turns * sums[start + count - 1] + within) * place.scale, 0.0


def law_contribution(
    kind: int, size: float, slope: float, along: float, omega: float, current: float
) -> tuple[float, float, float, float, float, float]:
    """What a law of a size, with a slope by the speed, adds to a piece: six contributions (effects.md eq. 1).

    Linear in size and slope, but that no more current is lost than there is. along: see `motion`.
    """
    if kind == LOSS:
        size = min(size, abs(current))
    return linear_contribution(kind, size, slope, along, omega, current)


def linear_contribution(
    kind: int, size: float, slope: float, along: float, omega: float, current: float
) -> tuple[float, float, float, float, float, float]:
    """The same while more than the loss is there. A drag over speed enters by its tangent at the piece's start.

    The sign of a loss does not count: no current comes from nowhere.
    """
    if kind == DRAG:  # sgn(omega) (size + slope (omega - omega_0))
        return 0.0, 0.0, along * slope, 0.0, 0.0, size - slope * omega
    if kind == _TORQUE:
        return 0.0, slope * omega - size, slope, 0.0, 0.0, 0.0
    if kind == _VISCOUS:
        return 0.0, 0.0, size, 0.0, 0.0, 0.0
    if kind == _WINDAGE:  # size omega |omega| by its tangent
        return 0.0, size * omega * abs(omega), 2.0 * size * abs(omega), 0.0, 0.0, 0.0
    if kind == _GAIN:
        return current * size, 0.0, 0.0, 0.0, 0.0, 0.0
    return -math.copysign(size, current) if current != 0.0 else 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
