"""Coulomb friction that changes with temperature; break-away friction moves by as much."""

from __future__ import annotations

from typing import ClassVar

from rw_ekf.effects.measures import STEADY_SHARE, dry_scale, temperature_range
from rw_ekf.effects.temperature_law import FrictionOfTemperature, relative_change, sentence_about, slope_of_change
from rw_ekf.model.effect import Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution
from rw_ekf.model.moment import Moment


class CoulombTemperature(FrictionOfTemperature):
    """c(T) = c [1 + a (T - 20 degC)], or c exp(a (T - 20 degC)), s moved by as much, so that s - c stays."""

    id = "coulomb_temperature"
    equation = "f = a (T - 20 degC) c sgn(omega), or [exp(a (T - 20 degC)) - 1] c sgn(omega)"
    source = "preload of the bearing that follows the expansion of shaft and housing; the boundary film"
    coefficient = Coefficient(
        "slope_1_K", "1/K", -1.0, 1.0, "relative change of Coulomb friction per kelvin, at 20 degC"
    )
    excitation = "reversals, the temperature cycled up and down: `rw-ekf excite identification` in a chamber"
    acts_as = "drag"
    confounded: ClassVar[dict[str, str]] = {
        "coulomb_drift": "a temperature that is cycled up and down within the record",
        "viscous_temperature": "several speeds, fast and slow, at each temperature",
        "motor_gain_temperature": "coast-downs without current, cold and warm",
        "drag_spike": "a temperature that is cycled up and down within the record",
    }

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """Half a percent of Coulomb friction over the range of temperature."""
        coulomb = max(facts.friction.coulomb, 1.0e-3 * dry_scale(facts))
        return STEADY_SHARE * dry_scale(facts) / (coulomb * temperature_range(facts))

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """20 % per kelvin: twice what the most viscous lubricant does (ASTM D341), and dry friction does less."""
        return 0.2

    @staticmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """Dry friction by the factor a (T - 20 degC), or exp of that less 1, of Coulomb friction."""
        return 0.0, 0.0, 0.0, 0.0, relative_change(a, q[0], at.temperature), 0.0

    @staticmethod
    def slope(a: float, q: Shape, at: Moment) -> Contribution:
        """T - 20 degC, times the exponential."""
        return 0.0, 0.0, 0.0, 0.0, slope_of_change(a, q[0], at.temperature), 0.0

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """In percent per kelvin."""
        return sentence_about("Coulomb friction", value, std, shape)
