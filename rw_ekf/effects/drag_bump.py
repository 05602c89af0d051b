"""More drag around one speed: lubricant or the bearing's cage in resonance."""

from __future__ import annotations

import math

from rw_ekf.effects.measures import (
    SOUGHT_SHARE,
    dry_scale,
    friction_at,
    largest_torque,
    of_coulomb,
    top_drive,
    top_speed,
)
from rw_ekf.model.effect import Candidate, Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution, StaticEffect
from rw_ekf.model.moment import Moment
from rw_ekf.units import rpm_from_rad_s

_WIDEST = 0.3  # of the top speed: a wider one is drag of another kind
_WIDTHS = tuple(0.24 * 0.5**halved for halved in range(8))  # of the top speed
_NARROW = 0.03  # of the top speed: what is narrower is sought at low speeds, up to so many widths
_NARROW_PLACES = 12
_NOTHING_LEFT = 300.0  # of an exponent: with less than 1e-308 a processor takes thirty times as long
_READINGS = 3.0  # across a bump at the fastest change of speed


def _narrowest(facts: RecordFacts) -> float:
    """What readings resolve [rad/s]: three of them across the bump where speed changes fastest, two sigma of one."""
    fastest = max(top_drive(facts), friction_at(facts, top_speed(facts)))
    return max(0.5 * _READINGS * fastest * facts.period_s, 2.0 * facts.speed_noise_rad_s)


class DragBump(StaticEffect):
    """f = sgn(omega) a exp(-((|omega| - speed)/width)^2), by its tangent; a bell for want of a shape from physics."""

    id = "drag_bump"
    equation = "f = sgn(omega) a exp(-((|omega| - speed)/width)^2)"
    source = "instability of the bearing's cage: Boesiger, Donley & Loewenthal 1992; resonance of the lubricant film"
    coefficient = Coefficient("amplitude_rad_s2", "rad/s^2", 0.0, 1.0e6, "drag added at the middle of the bump")
    constants = (
        Coefficient("speed_rad_s", "rad/s", 0.0, 1.0e6, "speed of most drag", step_share=0.005, reach_share=0.05),
        Coefficient("width_rad_s", "rad/s", 1.0e-6, 1.0e6, "from there to where 37 % of it is left", reach_share=0.3),
    )
    excitation = "slow passages through all speeds, with turning well above and below: `rw-ekf excite identification`"
    shown_against = "speed"
    refined = (0, 1)

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """One percent of Coulomb friction."""
        return SOUGHT_SHARE * dry_scale(facts)

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """What the motor can just hold, or three times the friction: the wheel would not come past a higher one."""
        return largest_torque(facts)

    @staticmethod
    def candidates(facts: RecordFacts) -> list[Candidate]:
        """Widths that the readings resolve, each at speeds a width apart, as far as both flanks are in the record."""
        top, found = top_speed(facts), []
        for width in (share * top for share in _WIDTHS if share * top >= _narrowest(facts)):
            count = math.floor((top - 1.5 * width) / width) + 1
            if width < _NARROW * top:
                count = min(count, _NARROW_PLACES)
            found += [Candidate(1.0, (width * (1 + i), width, 0.0)) for i in range(count)]
        return found

    @staticmethod
    def shape_is_possible(shape: Shape, facts: RecordFacts) -> bool:
        """Neither narrower than the readings resolve nor wide as a law of its own; both flanks within the record."""
        speed, width, _ = shape
        top = top_speed(facts)
        return _narrowest(facts) <= width <= _WIDEST * top and width <= speed <= top - 0.5 * width

    @classmethod
    def untestable(cls, facts: RecordFacts) -> str | None:
        """In a record too coarse, or of too few speeds, for any bump."""
        lacking = None if cls.candidates(facts) else "needs finer readings or faster sampling over more speeds"
        return super().untestable(facts) or lacking

    @staticmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """-f linearised at omega; a wheel at rest takes the direction of its current, for that way it would move."""
        forward = at.omega if at.omega != 0.0 else at.current
        if forward == 0.0:
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        offset = (abs(at.omega) - q[0]) / q[1]
        size = a * math.exp(-min(offset * offset, _NOTHING_LEFT))
        steepness = -2.0 * offset / q[1] * size
        return 0.0, at.omega * steepness - math.copysign(size, forward), steepness, 0.0, 0.0, 0.0

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """As a share of Coulomb friction, with speed and width."""
        speed, width, _ = shape
        return (
            f"Drag is {of_coulomb(value, std, facts)} higher around {speed:.3g} rad/s ({rpm_from_rad_s(speed):.3g} rpm)"
            f" and falls to 37 % of that within {width:.2g} rad/s"
        )
