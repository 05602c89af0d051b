"""Motor gain that changes with temperature: magnets weaken when warm."""

from __future__ import annotations

from typing import ClassVar

from rw_ekf.effects.measures import (
    STEADY_SHARE,
    dry_scale,
    lacks_current,
    lacks_temperature,
    slope_percent,
    temperature_range,
    top_drive,
)
from rw_ekf.model.effect import REFERENCE_DEGC, Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution, StaticEffect
from rw_ekf.model.moment import Moment


class MotorGainTemperature(StaticEffect):
    """k(T) = k [1 + a (T - 20 degC)]."""

    id = "motor_gain_temperature"
    equation = "f = -a (T - 20 degC) k I"
    source = "remanence of the magnets, resistance where a voltage drives"
    coefficient = Coefficient("slope_1_K", "1/K", -1.0, 1.0, "relative change of motor gain per kelvin")
    needs = ("temperature_degC",)
    lacking = (lacks_current, lacks_temperature)
    excitation = "strong currents, the temperature cycled up and down: `rw-ekf excite identification` in a chamber"
    shown_against = "temperature"
    acts_as = "motor torque"
    confounded: ClassVar[dict[str, str]] = {
        "coulomb_temperature": "coast-downs without current, cold and warm",
        "viscous_temperature": "coast-downs without current, cold and warm",
    }

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """Half a percent of Coulomb friction at top current over the range of temperature."""
        return STEADY_SHARE * dry_scale(facts) / (top_drive(facts) * temperature_range(facts))

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """5 % per kelvin: magnets lose 0.02 to 0.2 % (IEC 60404-8-1), copper gains 0.39 %."""
        return 0.05

    @staticmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """Current a (T - 20 degC) I more."""
        return a * (at.temperature - REFERENCE_DEGC) * at.current, 0.0, 0.0, 0.0, 0.0, 0.0

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """In percent per kelvin."""
        return slope_percent("Motor gain", value, std, "per K")
