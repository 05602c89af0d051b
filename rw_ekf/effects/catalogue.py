"""The catalogue: every effect in this package, found by walking it, so that adding one is one file."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Iterable
from typing import Any

import rw_ekf.effects
from rw_ekf.model.effect import Effect
from rw_ekf.model.effect_kinds import ReadingEffect, StribeckEffect, WanderingEffect

# Order of the table in docs/contract.md; what is not here comes behind, by alphabet.
CONTRACT_IDS = (
    "offset_torque", "viscous_asymmetry", "quadratic_drag", "cubic_drag", "viscous_temperature", "coulomb_temperature",
    "motor_gain_temperature", "motor_saturation", "current_deadzone", "actuator_lag", "transport_delay",
    "presliding_hysteresis", "friction_lag", "torque_ripple", "drag_spike", "coulomb_drift", "stribeck_shape",
    "external_torque", "speed_quantisation",
)  # fmt: skip
# What is no effect and looks at the others. Whatever else is in the package is imported and looked at.
MACHINERY = frozenset({"catalogue"})


def _effects_of(module_name: str) -> list[type[Effect]]:
    """Concrete effects that a module of the package defines."""
    module = importlib.import_module(f"{rw_ekf.effects.__name__}.{module_name}")
    return [
        found
        for found in vars(module).values()
        if inspect.isclass(found)
        and issubclass(found, Effect)
        and not inspect.isabstract(found)
        and found.__module__ == module.__name__
    ]


def _collect(module_names: Iterable[str]) -> dict[str, type[Effect]]:
    """Effects by id, in the order of the contract. Raises ValueError for an id used twice."""
    found: dict[str, type[Effect]] = {}
    for module_name in sorted(module_names):
        for effect in _effects_of(module_name):
            if effect.id in found:
                raise ValueError(f"effect {effect.id}: in {found[effect.id].__module__} and in {effect.__module__}")
            found[effect.id] = effect
    known = [effect_id for effect_id in CONTRACT_IDS if effect_id in found]
    return {effect_id: found[effect_id] for effect_id in [*known, *sorted(found.keys() - set(known))]}


CATALOGUE: dict[str, type[Effect]] = _collect(
    module.name for module in pkgutil.iter_modules(rw_ekf.effects.__path__) if module.name not in MACHINERY
)


def of_kind(kind: Any) -> list[type[Any]]:
    """The effects that derive from a class, in the order of the catalogue."""
    return [effect for effect in CATALOGUE.values() if issubclass(effect, kind)]


# What stands for torque as such, for a Stribeck curve that is fitted, for a reading on a grid, for dry friction that
# wanders in no particular shape: the rest of the package asks for these, and knows no effect by name.
TORQUE = CATALOGUE["offset_torque"]
(STRIBECK,) = of_kind(StribeckEffect)
(GRID,) = of_kind(ReadingEffect)
(WANDERING,) = of_kind(WanderingEffect)
