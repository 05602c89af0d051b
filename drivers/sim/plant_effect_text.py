"""Effects as a user writes them: `offset_torque` or `torque_ripple:order=6,amplitude_rad_s2=0.03`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import MISSING, Field, fields
from typing import Any

from rw_ekf.drivers.sim.plant_effects import EFFECTS, PlantEffect, with_effects
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
    known = {field.name: field for field in fields(kind)}
    values: dict[str, float | str] = {}
    for setting in filter(None, (part.strip() for part in settings.split(","))):
        key, equals, value = (part.strip() for part in setting.partition("="))
        if not equals or key not in known:
            raise BadInputError(
                f"effect {kind.id}: {setting!r} is not name=value of a parameter; it has: "
                + ", ".join(f"{field.name}={field.default}" for field in known.values())
            )
        if key in values:
            raise BadInputError(f"effect {kind.id}: {key} is given twice in {text!r}; give it once")
        values[key] = _value(kind.id, known[key], value)
    effect: PlantEffect = kind(**values)
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
            f"{field.name}={field.default:g}" if isinstance(field.default, float) else f"{field.name}={field.default}"
            for field in fields(kind)
            if field.default is not MISSING
        )
        lines.append(f"{name}:{defaults}  {(kind.__doc__ or '').splitlines()[0]}")
    return lines


def _value(effect: str, field: Field[Any], text: str) -> float | str:
    """A value as the parameter's default is: a word or a finite number."""
    if isinstance(field.default, str):
        return text
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadInputError(f"effect {effect}: {field.name} must be a number, not {text!r}")
    if value < 0.0 and field.name in NOT_NEGATIVE:
        raise BadInputError(f"effect {effect}: {field.name} must not be below 0, not {text}")
    return value


def _try(effect: PlantEffect) -> None:
    """Let the effect itself judge its numbers."""
    try:
        effect.applied_to(PlantParameters())
    except ValueError as error:
        raise BadInputError(str(error)) from error
