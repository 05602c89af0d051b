"""The equations of the wheel registered with numba: whoever compiles a pass over a log imports this first."""

from __future__ import annotations

import sys
from types import ModuleType

from rw_ekf.compiled import make_jitable
from rw_ekf.model import averages, flow, formula_program, friction, law, moment, state
from rw_ekf.wheel import dispatch, effect_table, effect_transition, interval, pieces, transition, window

make_jitable(
    [
        flow.slip,
        flow.flow,
        transition.interval,
        transition.transition,
        dispatch.contribution_slope,
        pieces._law_place,
        pieces._of_law,
        pieces._gather_laws,
        pieces._gather,
        pieces.driven_by,
        pieces._begin,
        pieces._lag,
        pieces.effect_interval,
    ],
    inlined=True,
)
make_jitable(
    [
        friction.far_limit,
        friction.stribeck,
        friction.stribeck_slope,
        averages.phi_1,
        averages.phi_1_slope,
        averages.sinc,
        flow._far_time,
        flow._step,
        flow._exp_small,
        flow._time_to_stop,
        interval.interval_after,
        interval.columns_at,
        interval.last_known,
        formula_program.known,
        formula_program.power_of,
        formula_program.one_argument,
        formula_program.of_any_number,
        formula_program.of_a_range,
        formula_program.exponential,
        formula_program.two_arguments,
        formula_program.moved,
        formula_program.formula_value,
        formula_program.formula_size,
        law.motion,
        law.point,
        law.arc,
        law.law_place,
        law.law_value,
        law.law_contribution,
        transition.factor_covariance,
        transition.reflection,
        transition._rests_for_sure,
        transition.divided_difference,
        *dispatch.JITABLE,
        dispatch.contribution,
        dispatch.lagged,
        dispatch.memory_flow,
        window.lateness,
        window.rounding,
        pieces.stribeck_of,
        pieces._chain_static,
        pieces._chain,
        pieces._memory_moved,
        pieces._chain_memory,
        pieces.row_size,
        effect_transition.turn_root,
        effect_transition.solve_slopes,
        effect_transition._differences,
        effect_transition.effect_transition,
        effect_transition.seed_hidden,
        effect_transition.open_past,
    ]
)

# Everything that is compiled into a pass with them: its cache is stale when one of them changes.
EQUATIONS: list[ModuleType] = [
    state, averages, friction, moment, flow, formula_program, law, interval, transition, dispatch, window, pieces,
    effect_transition, effect_table, *dispatch.MODULES, sys.modules[__name__],
]  # fmt: skip
