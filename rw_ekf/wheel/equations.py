"""All modules whose functions are compiled into a pass over a log: the equations of the wheel and its effects."""

from __future__ import annotations

import sys
from types import ModuleType

from rw_ekf.model import averages, flow, formula_program, friction, law, moment, state
from rw_ekf.wheel import dispatch, effect_table, effect_transition, interval, pieces, transition, window

# Everything that is compiled into a pass with them: its cache is stale when one of them changes.
EQUATIONS: list[ModuleType] = [
    state, averages, friction, moment, flow, formula_program, law, interval, transition, dispatch, window, pieces,
    effect_transition, effect_table, *dispatch.MODULES, sys.modules[__name__],
]  # fmt: skip
