"""No torque below a current: friction in a gear or commutation, a driver that cannot switch so briefly."""

from __future__ import annotations

from typing import ClassVar

from rw_ekf.effects.measures import STEADY_SHARE, dry_scale, lacks_current
from rw_ekf.model.effect import Candidate, Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution, StaticEffect
from rw_ekf.model.moment import Moment
from rw_ekf.numbers import plus_minus


class CurrentDeadzone(StaticEffect):
    """I - sgn(I) a drives the wheel, nothing while |I| <= a."""

    id = "current_deadzone"
    equation = "f = k sgn(I) min(|I|, a)"
    source = "blanking time of a switching amplifier, dry friction between motor and rotor"
    coefficient = Coefficient("width_A", "A", 0.0, 1.0e6, "largest current without torque")
    lacking = (lacks_current,)
    excitation = "currents of both signs at several levels, and coast-downs: `rw-ekf excite identification`"
    shown_against = "current"
    confounded: ClassVar[dict[str, str]] = {"motor_saturation": "strong currents beside weak ones"}
    linear = False  # below its width the effect takes the whole current

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """The current of half a percent of Coulomb friction."""
        return STEADY_SHARE * dry_scale(facts) / max(abs(facts.friction.motor_gain), 1.0e-12)

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """The top current: with a wider zone the motor would never have moved anything."""
        return max(facts.top_current_A, 1.0e-12)

    @staticmethod
    def candidates(facts: RecordFacts) -> list[Candidate]:
        """From a fifth of a percent of the strongest current to ten percent."""
        return [Candidate(facts.top_current_A * share) for share in (0.002, 0.01, 0.03, 0.1)]

    @staticmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """Current sgn(I) min(|I|, a) less. A filter on its way may look at a < 0: the line continues."""
        if at.current == 0.0:
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        lost = min(abs(at.current), a)
        return -lost if at.current > 0.0 else lost, 0.0, 0.0, 0.0, 0.0, 0.0

    @staticmethod
    def slope(a: float, q: Shape, at: Moment) -> Contribution:
        """-sgn(I) where the current is larger than the width."""
        if abs(at.current) <= a or at.current == 0.0:
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        return -1.0 if at.current > 0.0 else 1.0, 0.0, 0.0, 0.0, 0.0, 0.0

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """In milliamperes, and as a share of the strongest current."""
        text = f"Currents below {plus_minus(1e3 * value, 1e3 * std)} mA make no torque, and stronger ones lose as much"
        if facts.top_current_A <= 0.0:
            return text
        return f"{text} ({100.0 * value / facts.top_current_A:.2g} % of the strongest current)"
