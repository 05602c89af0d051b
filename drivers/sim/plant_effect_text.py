"""Effects as a user writes them: `offset_torque` or `torque_ripple:order=6,amplitude_rad_s2=0.03`."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rw_ekf.drivers.sim.plant_effects import EFFECTS, Number, PlantEffect, with_effects
from rw_ekf.drivers.sim.plant_parameters import PlantParameters
from rw_ekf.errors import BadInputError

# Numbers that cannot be negative: sizes, times and orders.
NOT_NEGATIVE = (
    "width_A", "time_constant_s", "delay_s", "deflection_rad", "damping", "order", "grid_rad_s", "frequency_Hz",
    "decay_s", "wander_rad_s2", "onset_s", "width_rad_s", "ratio", "window_s",
)  # fmt: skip


def parse_effect(text: str) -> PlantEffect:
    """The effect written as `ID` or `ID:name=value,name=value`; parameters left out take their defaults.

    Raises BadInputError that lists what exists for an unknown id or parameter, and says what a bad value is.
    """
    name, _, settings = text.partition(":")
    kind = EFFECTS.get(name.strip())
    if kind is None:
        raise BadInputError(f"unknown effect {name.strip()!r} in {text!r}; there are: {', '.join(EFFECTS)}")
    known = kind.numbers
    values: dict[str, float | str] = {}
    for setting in filter(None, (part.strip() for part in settings.split(","))):
        key, equals, value = (part.strip() for part in setting.partition("="))
        if not equals or key not in known:
            raise BadInputError(
                f"effect {kind.id}: {setting!r} is not name=value of a parameter; it has: "
                + ", ".join(f"{key}={number.default}" for key, number in known.items())
            )
        if key in values:
            raise BadInputError(f"effect {kind.id}: {key} is given twice in {text!r}; give it once")
        values[key] = _value(f"effect {kind.id}: {key}", key, known[key], value)
    effect = kind(**values)
    _try(effect)
    return effect


def parse_effects(texts: Sequence[str], parameters: PlantParameters | None = None) -> PlantParameters:
    """The wheel (default: the standard one) with all the effects written in `texts`. Raises BadInputError."""
    effects = [parse_effect(text) for text in texts]
    try:
        return with_effects(parameters if parameters is not None else PlantParameters(), effects)
    except ValueError as error:
        raise BadInputError(str(error)) from error


def describe_effects() -> list[str]:
    """One line for each effect: id with its parameters' defaults, and the first sentence of what it is."""
    lines = []
    for name, kind in EFFECTS.items():
        defaults = ",".join(
            f"{key}={number.default:g}" if isinstance(number.default, float) else f"{key}={number.default}"
            for key, number in kind.numbers.items()
        )
        lines.append(f"{name}:{defaults}  {kind.meaning}")
    return lines


def effect_documents() -> list[dict[str, object]]:
    """The same as a document has them, and whether `diagnose` knows the effect."""
    return [
        {
            "effect": name,
            "in_catalogue": kind.in_catalogue,
            "parameters": {key: number.default for key, number in kind.numbers.items()},
            "meaning": kind.meaning,
        }
        for name, kind in EFFECTS.items()
    ]


def _value(place: str, name: str, number: Number, text: str) -> float | str:
    """A value as the number's default is: a word or a finite number."""
    if isinstance(number.default, str):
        return text
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadInputError(f"{place} must be a number, not {text!r}")
    if value < 0.0 and name in NOT_NEGATIVE:
        raise BadInputError(f"{place} must not be below 0, not {text}")
    return value


def _try(effect: PlantEffect) -> None:
    """Let the effect itself judge its numbers."""
    try:
        effect.applied_to(PlantParameters())
    except ValueError as error:
        raise BadInputError(str(error)) from error
