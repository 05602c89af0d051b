"""Viscous friction that changes with temperature: the lubricant's viscosity."""

from __future__ import annotations

from typing import ClassVar

from rw_ekf.effects.measures import STEADY_SHARE, dry_scale, temperature_range, top_speed
from rw_ekf.effects.temperature_law import FrictionOfTemperature, relative_change, sentence_about, slope_of_change
from rw_ekf.model.effect import Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution
from rw_ekf.model.moment import Moment


class ViscousTemperature(FrictionOfTemperature):
    """b(T) = b [1 + a (T - 20 degC)], or b exp(a (T - 20 degC))."""

    id = "viscous_temperature"
    equation = "f = a (T - 20 degC) b omega, or [exp(a (T - 20 degC)) - 1] b omega"
    source = "viscosity of the lubricant"
    coefficient = Coefficient(
        "slope_1_K", "1/K", -1.0, 1.0, "relative change of viscous friction per kelvin, at 20 degC"
    )
    excitation = "high speed, the temperature cycled up and down: `rw-ekf excite identification` in a chamber"
    acts_as = "viscous drag"
    confounded: ClassVar[dict[str, str]] = {
        "coulomb_temperature": "several speeds, fast and slow, at each temperature",
        "motor_gain_temperature": "coast-downs without current, cold and warm",
    }

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """Half a percent of Coulomb friction at top speed over the range of temperature."""
        viscous = max(abs(facts.friction.viscous) * top_speed(facts), 1.0e-3 * dry_scale(facts))
        return STEADY_SHARE * dry_scale(facts) / (viscous * temperature_range(facts))

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """50 % per kelvin: a cold lubricant loses 10 % (ASTM D341), a thermometer near it sees some of its warmth."""
        return 0.5

    @staticmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """Viscous friction by the factor a (T - 20 degC), or exp of that less 1."""
        return 0.0, 0.0, 0.0, relative_change(a, q[0], at.temperature), 0.0, 0.0

    @staticmethod
    def slope(a: float, q: Shape, at: Moment) -> Contribution:
        """T - 20 degC, times the exponential."""
        return 0.0, 0.0, 0.0, slope_of_change(a, q[0], at.temperature), 0.0, 0.0

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """In percent per kelvin."""
        return sentence_about("Viscous friction", value, std, shape)
