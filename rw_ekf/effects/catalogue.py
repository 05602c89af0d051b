"""The catalogue: every effect in this package, found by walking it, and those that installed packages register.

Effects by formulas of a user's own stand in it for as long as something is done with them (`with_own`).
"""

from __future__ import annotations

import contextlib
import importlib
import inspect
import pkgutil
from collections.abc import Iterable, Iterator, Mapping
from contextvars import ContextVar
from types import ModuleType
from typing import Any

import rw_ekf.effects
from rw_ekf.errors import ConfigError
from rw_ekf.model.effect import Effect
from rw_ekf.model.effect_kinds import LawEffect, ReadingEffect, StribeckEffect, WanderingEffect
from rw_ekf.plugins import added, loaded, refused

# Order of the table in docs/contract.md; what is not here comes behind, by alphabet.
CONTRACT_IDS = (
    "offset_torque", "viscous_asymmetry", "quadratic_drag", "cubic_drag", "viscous_temperature", "coulomb_temperature",
    "motor_gain_temperature", "motor_saturation", "current_deadzone", "actuator_lag", "transport_delay",
    "presliding_hysteresis", "friction_lag", "torque_ripple", "drag_spike", "coulomb_drift", "stribeck_shape",
    "external_torque", "speed_quantisation",
)  # fmt: skip
# What is no effect and looks at the others. Whatever else is in the package is imported and looked at.
MACHINERY = frozenset({"catalogue", "own_effect"})


_ONE_OF_A_KIND = (ReadingEffect, StribeckEffect, WanderingEffect, LawEffect)


def _own_modules() -> list[ModuleType]:
    names = sorted(module.name for module in pkgutil.iter_modules(rw_ekf.effects.__path__))
    return [importlib.import_module(f"{rw_ekf.effects.__name__}.{name}") for name in names if name not in MACHINERY]


def _added_modules() -> list[ModuleType]:
    """Modules that installed packages register. Raises ConfigError for one without an effect, or with a second grid."""
    modules = []
    for point in added("rw_ekf.effects").values():
        module = loaded(point)
        found = _effects_of(module) if inspect.ismodule(module) else []
        if not found:
            raise refused(
                point, "must name a module with a class that derives from an effect of rw_ekf.model.effect_kinds"
            )
        if any(issubclass(effect, _ONE_OF_A_KIND) for effect in found):
            raise refused(
                point, "has an effect of a kind of which there can be but one: a grid, a Stribeck law, a walk"
            )
        modules.append(module)
    return modules


def _effects_of(module: ModuleType) -> list[type[Effect]]:
    """Concrete effects that a module defines."""
    return [
        found
        for found in vars(module).values()
        if inspect.isclass(found)
        and issubclass(found, Effect)
        and not inspect.isabstract(found)
        and found.__module__ == module.__name__
    ]


def _collect(modules: Iterable[ModuleType]) -> dict[str, type[Effect]]:
    """Effects by id, in the order of the contract. Raises ConfigError for an id used twice."""
    found: dict[str, type[Effect]] = {}
    for module in modules:
        for effect in _effects_of(module):
            if effect.id in found:
                both = f"{found[effect.id].__module__} and in {effect.__module__}"
                raise ConfigError(f"the effect {effect.id} is in {both}: give one of them another id")
            found[effect.id] = effect
    known = [effect_id for effect_id in CONTRACT_IDS if effect_id in found]
    return {effect_id: found[effect_id] for effect_id in [*known, *sorted(found.keys() - set(known))]}


_OWN: ContextVar[dict[str, type[Effect]]] = ContextVar("own effects", default={})  # noqa: B039 - never changed


class _Catalogue(Mapping[str, type[Effect]]):
    """Effects by id: those that are always there, then a user's own."""

    def __init__(self, found: dict[str, type[Effect]]) -> None:
        self._found = found

    def __getitem__(self, effect_id: str) -> type[Effect]:
        return self._found[effect_id] if effect_id in self._found else _OWN.get()[effect_id]

    def __iter__(self) -> Iterator[str]:
        yield from self._found
        yield from _OWN.get()

    def __len__(self) -> int:
        return len(self._found) + len(_OWN.get())


@contextlib.contextmanager
def with_own(effects: Iterable[type[Effect]]) -> Iterator[None]:
    """Within this the catalogue has these effects as well. Raises ConfigError where two of one id differ."""
    own = dict(_OWN.get())
    for effect in effects:
        if own.setdefault(effect.id, effect) is not effect:
            raise ConfigError(
                f"the effect {effect.id} has two formulas, {own[effect.id].equation} and {effect.equation}: give one "
                "of them another id"
            )
    token = _OWN.set(own)
    try:
        yield
    finally:
        _OWN.reset(token)


ADDED_MODULES = _added_modules()
MODULES = [*_own_modules(), *ADDED_MODULES]
_FOUND = _collect(MODULES)
CATALOGUE = _Catalogue(_FOUND)
CATALOGUE_IDS = frozenset(_FOUND)  # those that are always there


def of_kind(kind: Any) -> list[type[Any]]:
    """The effects that derive from a class, in the order of the catalogue."""
    return [effect for effect in CATALOGUE.values() if issubclass(effect, kind)]


FORMULAS = [effect for effect in CATALOGUE.values() if not issubclass(effect, LawEffect)]

# What stands for torque as such, for a Stribeck curve that is fitted, for a reading on a grid, for dry friction that
# wanders in no particular shape: the rest of the package uses these, and knows no effect by name.
TORQUE = CATALOGUE["offset_torque"]
DEADZONE = CATALOGUE["current_deadzone"]
(STRIBECK,) = of_kind(StribeckEffect)
(GRID,) = of_kind(ReadingEffect)
(WANDERING,) = of_kind(WanderingEffect)
LEARNED, CHANGE, SPELL = (CATALOGUE[name] for name in ("learned_law", "change", "spell"))
