"""Windage: drag that grows with the square of the speed."""

from __future__ import annotations

from typing import ClassVar

from rw_ekf.effects.measures import STEADY_SHARE, dry_scale, friction_at, of_coulomb, top_speed
from rw_ekf.model.effect import Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution, StaticEffect
from rw_ekf.model.moment import Moment


class QuadraticDrag(StaticEffect):
    """f = a omega |omega|."""

    id = "quadratic_drag"
    equation = "f = a omega |omega|"
    source = "aerodynamic drag of the rotor in its case"
    coefficient = Coefficient("coefficient_1_rad", "1/rad", -1.0e3, 1.0e3, "drag per squared speed; above 0 brakes")
    excitation = "high speed with coast-downs: `rw-ekf excite identification`"
    shown_against = "speed"
    smooth_over_speed = True
    confounded: ClassVar[dict[str, str]] = {
        "motor_saturation": "a coast-down from high speed without current",
        "cubic_drag": "a wider range of speeds",
    }

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """Half a percent of Coulomb friction at the top speed."""
        return STEADY_SHARE * dry_scale(facts) / top_speed(facts) ** 2

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """Three times all friction at the top speed: the base model has it all there already."""
        return 3.0 * friction_at(facts, top_speed(facts)) / top_speed(facts) ** 2

    @staticmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """-f linearised at omega: external a omega |omega|, viscous 2 a |omega|."""
        return 0.0, a * at.omega * abs(at.omega), 2.0 * a * abs(at.omega), 0.0, 0.0, 0.0

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """As a share of Coulomb friction at the top speed."""
        squared = facts.top_speed_rad_s**2
        way = "grows" if value > 0.0 else "falls short"
        size = of_coulomb(squared * abs(value), squared * std, facts)
        return f"Drag {way} with the square of the speed, by {size} at top speed"
