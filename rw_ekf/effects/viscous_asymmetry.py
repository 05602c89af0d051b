"""Viscous friction that differs by direction."""

from __future__ import annotations

from typing import ClassVar

from rw_ekf.effects.measures import STEADY_SHARE, dry_scale, friction_at, lacks_reversal, top_speed
from rw_ekf.model.effect import Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution, StaticEffect
from rw_ekf.model.moment import Moment
from rw_ekf.numbers import plus_minus


class ViscousAsymmetry(StaticEffect):
    """f = a |omega|: viscous friction b + a forward, b - a backward."""

    id = "viscous_asymmetry"
    equation = "f = a |omega|"
    source = "preload and flow of lubricant that differ by the direction of turning"
    coefficient = Coefficient("difference_1_s", "1/s", -1.0e3, 1.0e3, "viscous friction more forward, less backward")
    lacking = (lacks_reversal,)  # one way only, the difference is viscous friction
    excitation = "high speed in both directions: `rw-ekf excite identification`"
    shown_against = "speed"
    confounded: ClassVar[dict[str, str]] = {"offset_torque": "several speeds, fast and slow, in both directions"}

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """Half a percent of Coulomb friction at the top speed."""
        return STEADY_SHARE * dry_scale(facts) / top_speed(facts)

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """Friction at top speed drives in neither direction: the difference is no more than all of it."""
        return friction_at(facts, top_speed(facts)) / top_speed(facts)

    @staticmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """Viscous a sgn(omega); a wheel at rest takes the direction of its current, for that way it would move."""
        forward = at.omega if at.omega != 0.0 else at.current
        if forward == 0.0:
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        return 0.0, 0.0, a if forward > 0.0 else -a, 0.0, 0.0, 0.0

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """As a share of viscous friction, where there is any."""
        more, less = ("forward", "backward") if value > 0.0 else ("backward", "forward")
        viscous = facts.friction.viscous
        if viscous <= 0.0:
            return f"Viscous friction is {plus_minus(abs(value), std)} 1/s higher {more} and as much lower {less}"
        size = plus_minus(100.0 * abs(value) / viscous, 100.0 * std / viscous)
        return f"Viscous friction is {size} % higher {more} and as much lower {less}"
