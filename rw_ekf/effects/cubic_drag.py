"""Drag that grows with the cube of the speed: a drag curve shaped like an S."""

from __future__ import annotations

from typing import ClassVar

from rw_ekf.effects.measures import STEADY_SHARE, dry_scale, friction_at, of_coulomb, top_speed
from rw_ekf.model.effect import Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution, StaticEffect
from rw_ekf.model.moment import Moment


class CubicDrag(StaticEffect):
    """f = a omega^3."""

    id = "cubic_drag"
    equation = "f = a omega^3"
    source = "drag that grows faster or slower than viscous: lubricant that churns, or shears thinner when fast"
    coefficient = Coefficient("coefficient_s_rad2", "s/rad^2", -1.0e6, 1.0e6, "drag per cubed speed; above 0 brakes")
    excitation = "coast-downs from high speed: `rw-ekf excite identification`"
    shown_against = "speed"
    smooth_over_speed = True
    confounded: ClassVar[dict[str, str]] = {"quadratic_drag": "a wider range of speeds"}

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """Half a percent of Coulomb friction at the top speed."""
        return STEADY_SHARE * dry_scale(facts) / top_speed(facts) ** 3

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """Three times all friction at the top speed: the base model has it all there already."""
        return 3.0 * friction_at(facts, top_speed(facts)) / top_speed(facts) ** 3

    @staticmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """-f linearised at omega: external 2 a omega^3, viscous 3 a omega^2."""
        return 0.0, 2.0 * a * at.omega * at.omega * at.omega, 3.0 * a * at.omega * at.omega, 0.0, 0.0, 0.0

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """As a share of Coulomb friction at the top speed."""
        cubed = facts.top_speed_rad_s**3
        way = "grows" if value > 0.0 else "falls short"
        size = of_coulomb(cubed * abs(value), cubed * std, facts)
        return f"Drag {way} with the cube of the speed, by {size} at top speed"
