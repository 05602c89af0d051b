"""Viscous friction that changes with temperature: the lubricant's viscosity."""

from __future__ import annotations

import math
from typing import ClassVar

from rw_ekf.effects.measures import (
    STEADY_SHARE,
    dry_scale,
    lacks_temperature,
    slope_percent,
    temperature_range,
    top_speed,
)
from rw_ekf.model.effect import REFERENCE_DEGC, Candidate, Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution, StaticEffect
from rw_ekf.model.moment import Moment

_LAWS = ("linear", "exponential")
_EXPONENTIAL = 1.0
_MOST = 30.0  # of an exponent: exp(30) is 1e13, and a coefficient gone wild must not overflow


class ViscousTemperature(StaticEffect):
    """b(T) = b [1 + a (T - 20 degC)], or b exp(a (T - 20 degC)): the two are one while little changes.

    A lubricant's viscosity falls exponentially over the tens of kelvins that a bearing sees (ASTM D341, whose double
    logarithm is that to first order): a straight line through a fall by half misses its slope by ten of its sigmas.
    """

    id = "viscous_temperature"
    equation = "f = a (T - 20 degC) b omega, or [exp(a (T - 20 degC)) - 1] b omega"
    source = "viscosity of the lubricant"
    coefficient = Coefficient(
        "slope_1_K", "1/K", -1.0, 1.0, "relative change of viscous friction per kelvin, at 20 degC"
    )
    constants = (
        Coefficient("law", "", 0.0, 1.0, "code of the law: 0 linear, 1 exponential", whole=True, optional=True),
    )
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
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """Viscous friction by the factor a (T - 20 degC), or exp of that less 1."""
        change = a * (at.temperature - REFERENCE_DEGC)
        if q[0] == _EXPONENTIAL:
            change = math.expm1(min(change, _MOST))
        return 0.0, 0.0, 0.0, change, 0.0, 0.0

    @staticmethod
    def slope(a: float, q: Shape, at: Moment) -> Contribution:
        """T - 20 degC, times the exponential."""
        change = at.temperature - REFERENCE_DEGC
        if q[0] == _EXPONENTIAL:
            change *= math.exp(min(a * change, _MOST))
        return 0.0, 0.0, 0.0, change, 0.0, 0.0

    @classmethod
    def starts(cls, candidate: Candidate, found: float) -> list[Candidate]:
        """By either law."""
        return [Candidate(found, (float(code), 0.0, 0.0)) for code in range(len(_LAWS))]

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """In percent per kelvin."""
        if shape[0] != _EXPONENTIAL:
            return slope_percent("Viscous friction", value, std, "per K")
        return slope_percent("Viscous friction", value, std, "per K at 20 degC, exponentially")

    @classmethod
    def described(cls, value: float, std: float, shape: Shape) -> dict[str, dict[str, float | str | None]]:
        """The law by its name."""
        found = super().described(value, std, shape)
        found["law"] = {"value": _LAWS[int(shape[0])], "std": None, "unit": ""}
        return found
