"""Motor gain that falls with the current: saturating iron."""

from __future__ import annotations

from typing import ClassVar

from rw_ekf.effects.measures import STEADY_SHARE, dry_scale, lacks_current, top_drive
from rw_ekf.model.effect import Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution, StaticEffect
from rw_ekf.model.moment import Moment
from rw_ekf.numbers import plus_minus


class MotorSaturation(StaticEffect):
    """k(I) = k (1 - a |I|)."""

    id = "motor_saturation"
    equation = "f = a |I| k I"
    source = "iron that saturates: less flux per ampere at strong currents"
    coefficient = Coefficient("slope_1_A", "1/A", 0.0, 1.0e6, "relative loss of motor gain per ampere")
    lacking = (lacks_current,)
    excitation = "short strong currents beside weak ones: `rw-ekf excite identification`"
    shown_against = "current"
    confounded: ClassVar[dict[str, str]] = {
        "quadratic_drag": "a coast-down from high speed without current",
        "current_deadzone": "strong currents beside weak ones",
    }

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """Half a percent of Coulomb friction at top current."""
        return STEADY_SHARE * dry_scale(facts) / (top_drive(facts) * max(facts.top_current_A, 1.0e-12))

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """Where the torque at the top current would be none at all."""
        return 1.0 / max(facts.top_current_A, 1.0e-12)

    @staticmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """Current a |I| I less."""
        return -a * abs(at.current) * at.current, 0.0, 0.0, 0.0, 0.0, 0.0

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """As the loss at the strongest current of the record."""
        percent = 100.0 * facts.top_current_A
        size = plus_minus(percent * abs(value), percent * std)
        return f"Motor gain is {size} % {'lower' if value > 0.0 else 'higher'} at the strongest current than at none"
