"""Viscous friction that changes with temperature: the lubricant's viscosity."""

from __future__ import annotations

from typing import ClassVar

from rw_ekf.effects.measures import (
    STEADY_SHARE,
    dry_scale,
    lacks_temperature,
    slope_percent,
    temperature_range,
    top_speed,
)
from rw_ekf.model.effect import REFERENCE_DEGC, Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution, StaticEffect


class ViscousTemperature(StaticEffect):
    """b(T) = b [1 + a (T - 20 degC)]."""

    id = "viscous_temperature"
    equation = "f = a (T - 20 degC) b omega"
    source = "viscosity of the lubricant"
    coefficient = Coefficient("slope_1_K", "1/K", -1.0, 1.0, "relative change of viscous friction per kelvin")
    needs = ("temperature_degC",)
    lacking = (lacks_temperature,)
    excitation = "high speed, the temperature cycled up and down: `rw-ekf excite identification` in a chamber"
    shown_against = "temperature"
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
    def contribution(
        a: float, q1: float, q2: float, q3: float,
        omega: float, current: float, temperature: float, angle: float, time: float, duration: float,
    ) -> Contribution:  # fmt: skip
        """Viscous friction by the factor a (T - 20 degC)."""
        return 0.0, 0.0, 0.0, a * (temperature - REFERENCE_DEGC), 0.0, 0.0

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """In percent per kelvin."""
        return slope_percent("Viscous friction", value, std, "per K")
