"""What frictions that change with temperature share: a straight line through it, or an exponential.

A lubricant's viscosity falls exponentially over the tens of kelvins that a bearing sees (ASTM D341, whose double
logarithm is that to first order): a straight line through a fall by half misses its slope by ten of its sigmas.
"""

from __future__ import annotations

import math

from rw_ekf.effects.measures import lacks_temperature, slope_percent
from rw_ekf.model.effect import REFERENCE_DEGC, Candidate, Coefficient, Shape
from rw_ekf.model.effect_kinds import StaticEffect

_LAWS = ("linear", "exponential")
_EXPONENTIAL = 1.0
_MOST = 30.0  # of an exponent: exp(30) is 1e13, and a coefficient gone wild must not overflow


def relative_change(a: float, law: float, temperature_degC: float) -> float:
    """A (T - 20 degC), or exp of that less 1."""
    change = a * (temperature_degC - REFERENCE_DEGC)
    if law == _EXPONENTIAL:
        change = math.expm1(min(change, _MOST))
    return change


def slope_of_change(a: float, law: float, temperature_degC: float) -> float:
    """T - 20 degC, times the exponential."""
    change = temperature_degC - REFERENCE_DEGC
    if law == _EXPONENTIAL:
        change *= math.exp(min(a * change, _MOST))
    return change


class FrictionOfTemperature(StaticEffect):
    """A friction by the factor 1 + a (T - 20 degC), or exp(a (T - 20 degC)): the two are one while little changes."""

    constants = (
        Coefficient("law", "", 0.0, 1.0, "code of the law: 0 linear, 1 exponential", whole=True, optional=True),
    )
    needs = ("temperature_degC",)
    lacking = (lacks_temperature,)
    shown_against = "temperature"

    @classmethod
    def starts(cls, candidate: Candidate, found: float) -> list[Candidate]:
        """By either law."""
        return [Candidate(found, (float(code), 0.0, 0.0)) for code in range(len(_LAWS))]

    @classmethod
    def described(cls, value: float, std: float, shape: Shape) -> dict[str, dict[str, float | str | None]]:
        """The law by its name."""
        found = super().described(value, std, shape)
        found["law"] = {"value": _LAWS[int(shape[0])], "std": None, "unit": ""}
        return found


def sentence_about(friction: str, value: float, std: float, shape: Shape) -> str:
    """In percent per kelvin."""
    if shape[0] != _EXPONENTIAL:
        return slope_percent(friction, value, std, "per K")
    return slope_percent(friction, value, std, "per K at 20 degC, exponentially")
