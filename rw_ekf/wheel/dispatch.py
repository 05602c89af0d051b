"""One compiled call for every effect of the catalogue: the choice by code is written out, so that it can be printed.

A new effect's file is found by the catalogue and needs no line here. The functions below are ordinary Python too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

from rw_ekf.effects import catalogue
from rw_ekf.effects.catalogue import of_kind
from rw_ekf.model import memory_coast as memory_coast_home
from rw_ekf.model import memory_flow as memory_flow_home
from rw_ekf.model.effect_kinds import CurrentEffect, FrictionMemoryEffect, StaticEffect

_STATIC_ARGUMENTS = "a, q, at"
_LAG_ARGUMENTS = "a, q, state, current, duration"
_FLOW_ARGUMENTS = "omega, memory, drive, curve, a, q, duration"


def _choice(
    name: str, arguments: str, functions: Sequence[Callable[..., Any]], given: Sequence[str] = ()
) -> Callable[..., Any]:
    """A function `name(code, arguments)` that calls functions[code], written out: what is printed as C has no closures.

    given: what each function is called with, where that is not the arguments.
    """
    calls = [f"function_{i}({text})" for i, text in enumerate(given or [arguments] * len(functions))]
    lines = [f"def {name}(code, {arguments}):"]
    lines += [f"    if code == {i}:\n        return {call}" for i, call in enumerate(calls[1:], start=1)]
    lines.append(f"    return {calls[0]}" if calls else "    return None")
    namespace: dict[str, Any] = {f"function_{i}": function for i, function in enumerate(functions)}
    namespace["__name__"] = __name__
    exec("\n".join(lines), namespace)
    made: Callable[..., Any] = namespace[name]
    vars(made)["source"] = "\n".join(lines)  # for `rw_ekf.c_code`, which prints it
    return made


STATIC_EFFECTS = of_kind(StaticEffect)
CURRENT_EFFECTS = of_kind(CurrentEffect)
MEMORY_EFFECTS = of_kind(FrictionMemoryEffect)

contribution = _choice("contribution", _STATIC_ARGUMENTS, [effect.contribution for effect in STATIC_EFFECTS])
_PROPORTIONAL = [effect.is_proportional() for effect in STATIC_EFFECTS]
contribution_slope = _choice(  # of a proportional effect the contribution of a = 1
    "contribution_slope",
    _STATIC_ARGUMENTS,
    [e.contribution if simply else e.slope for e, simply in zip(STATIC_EFFECTS, _PROPORTIONAL, strict=True)],
    [_STATIC_ARGUMENTS.replace("a,", "1.0,", 1) if simply else _STATIC_ARGUMENTS for simply in _PROPORTIONAL],
)
lagged = _choice("lagged", _LAG_ARGUMENTS, [effect.lagged for effect in CURRENT_EFFECTS])
memory_flow = _choice("memory_flow", _FLOW_ARGUMENTS, [effect.flow for effect in MEMORY_EFFECTS])

# Every module of an effect, and what its functions call: the compiled passes are stale when one of them changes.
MODULES: list[ModuleType] = [*catalogue.MODULES, memory_coast_home, memory_flow_home]
