"""An effect: a lip seal, whose drag grows with the root of the speed."""

from __future__ import annotations

import math
from typing import ClassVar

from rw_ekf.effects.measures import STEADY_SHARE, dry_scale, of_coulomb, top_speed
from rw_ekf.model.effect import Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution, StaticEffect
from rw_ekf.model.moment import Moment


class SealDrag(StaticEffect):
    """f = a sign(omega) sqrt|omega|."""

    id = "seal_drag"
    equation = "f = a sign(omega) sqrt(|omega|)"
    source = "lip seals run on a film whose thickness grows with the root of the speed"
    coefficient = Coefficient(
        "coefficient_rad_s3", "(rad/s)^1.5/s", -1.0e3, 1.0e3, "drag per root of speed; above 0 brakes"
    )
    excitation = "speeds from rest to the top: `rw-ekf excite identification`"
    shown_against = "speed"
    confounded: ClassVar[dict[str, str]] = {"quadratic_drag": "a wider range of speeds"}

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """Half a percent of Coulomb friction at the top speed."""
        return STEADY_SHARE * dry_scale(facts) / math.sqrt(top_speed(facts))

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """Ten times Coulomb friction at the top speed."""
        return 10.0 * dry_scale(facts) / math.sqrt(top_speed(facts))

    @staticmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """-f linearised at omega: slope a / (2 sqrt|omega|)."""
        speed = max(abs(at.omega), 1.0e-3)
        slope = 0.5 * a / math.sqrt(speed)
        return 0.0, -a * math.copysign(math.sqrt(speed), at.omega) + slope * at.omega, slope, 0.0, 0.0, 0.0

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """As a share of Coulomb friction at the top speed."""
        root = math.sqrt(facts.top_speed_rad_s)
        return f"The seal drags by {of_coulomb(root * value, root * std, facts)} at top speed"
