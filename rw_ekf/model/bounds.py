"""What a model of a wheel can be: bounds on its numbers, wide enough for every known machine.

The smallest rotors (1e-9 kg m^2 at 1 mN m/A) have a motor gain of 1e6 rad/s^2/A, a carriage driven by newtons 0.01 and
less. Ten times beyond is a slip of the pen or damage, and from there on numbers overflow.
"""

from __future__ import annotations

from collections.abc import Mapping

# Lowest and highest value [unit of the parameter]. Viscous friction below zero is what a fit makes of friction that
# falls with speed; below -1 1/s a wheel would run away within seconds.
VALUES: Mapping[str, tuple[float, float]] = {
    "motor_gain": (-1.0e7, 1.0e7),
    "viscous": (-1.0, 1.0e4),
    "coulomb": (0.0, 1.0e6),
    "static": (0.0, 1.0e6),
}
NOISE_OF_ZERO_STDS = 5.0  # an estimate of a friction that is hardly there may lie so far below zero
STRIBECK_SPEED_RAD_S = (1.0e-9, 1.0e6)
SPEED_NOISE_RAD_S = (1.0e-9, 1.0e4)
ACCELERATION_NOISE = (0.0, 1.0e4)
DRY_WALK = (0.0, 1.0e4)
LONGEST_TEMPERATURE_LAG_S = 1.0e6
INERTIA_KG_M2 = (1.0e-12, 1.0e6)
ASSUMED = "assumed"  # `inertia_from` of a model whose inertia is the default: nobody gave it
LEAST_STD = 1.0e-12
LEAST_EFFECT_STD = 1.0e-18  # cubic drag has coefficients of 1e-9 s/rad^2
LEAST_RELATIVE_STD = 1.0e-9  # no estimate knows more digits: a model is not that right
MOST_STD = 1.0e6
MOST_RELATIVE_STD = 1.0e3


def value_fault(name: str, value: float, std: float | None = None) -> str | None:
    """What is wrong with a parameter's value: "is -4; coulomb lies between 0 and 1e+06 rad/s^2", or None.

    std: with it an estimate may lie below zero by what its own sigma allows.
    """
    low, high = VALUES[name]
    slack = NOISE_OF_ZERO_STDS * std if std is not None and low == 0.0 else 0.0
    if low - slack <= value <= high:
        return None
    allowed = f" (or {NOISE_OF_ZERO_STDS:g} of its standard deviations below zero)" if low == 0.0 else ""
    return f"is {value:g}; no machine is like that: {name} lies between {low:g} and {high:g}{allowed}"


def std_fault(value: float, std: float, *, least: float = LEAST_STD) -> str | None:
    """What is wrong with a standard deviation, given the value it belongs to; None if nothing."""
    low = max(least, LEAST_RELATIVE_STD * abs(value))
    high = max(MOST_STD, MOST_RELATIVE_STD * abs(value))
    if low <= std <= high:
        return None
    why = "nothing is known that well" if std < low else "that says nothing, and overflows"
    return f"has the standard deviation {std:.3g}; it must lie between {low:.3g} and {high:.3g}: {why}"
