"""wheel.h and wheel.c: the wheel of a model, printed from the functions that the estimator predicts with."""

from __future__ import annotations

from rw_ekf.c_code.c_program import Program
from rw_ekf.c_code.c_text import definitions, prototypes, public_structures
from rw_ekf.c_code.c_types import ATOM, Scalar, Value
from rw_ekf.flight import exported_plant
from rw_ekf.flight.c_files import start_of
from rw_ekf.flight.own_formulas import FORMULA_BOUNDS, formulas_instead
from rw_ekf.model.friction import Stribeck
from rw_ekf.wheel.effect_table import EffectTable

# A step of a lagging current is an eighth of what is left until that is four time constants: 300 lead past the
# smallest part of a step that a double can distinguish from nothing (8/7 to the power of 277 is 1e16).
_LAG_TURNS = 320


def printed_plant(held: exported_plant.Plant, table: EffectTable, stribeck: Stribeck) -> Program:
    """The program; raises NotPrintableError for what has no C."""
    laws = {stribeck.law}
    if table.stribeck_at >= 0:
        laws.add(table.stribeck_law)
    room = int(held.pieces.begin_s.size)  # pieces of current that it remembers
    whiles = {"effect_interval": (room, room + 1, _LAG_TURNS), "rounding": (room,)}
    domains = {"law": frozenset(laws)}
    program = Program(
        single=False, clocks=frozenset(), bounds=FORMULA_BOUNDS, whiles=whiles, domains=domains, by_flags=True,
        instead=formulas_instead(table),
    )  # fmt: skip
    here = Value("held", program.hold(held), by_address=True)
    program.name_known(stribeck, "stribeck")
    program.name_known(table, "effects")
    effects, peak = Value("", None, ATOM, table), Value("", None, ATOM, stribeck)
    around = Value("around", program.structure(exported_plant.Surroundings))
    amount = Value("", Scalar("real"))
    program.entry(exported_plant.begin, "rw_wheel_begin", [here, effects, amount])
    program.entry(exported_plant.turn, "rw_wheel_turn", [here, effects, peak, around, amount])
    program.entry(exported_plant.friction_now, "rw_wheel_friction", [here, effects, peak, around])
    return program


def plant_header(program: Program, held: exported_plant.Plant, origin: str) -> str:
    """wheel.h."""
    return f"""/* {origin} */
#ifndef RW_WHEEL_H
#define RW_WHEEL_H

#include <stdbool.h>

typedef double rw_real;

#define RW_WHEEL_STATES {held.x.size}

{public_structures(program)}
/* What a wheel of this model begins with; before anything else. */
void rw_wheel_start(struct rw_plant *held);

{prototypes(program)}
#endif
"""


def plant_source(program: Program, held: exported_plant.Plant, origin: str) -> str:
    """wheel.c."""
    start = start_of(program, "rw_wheel_start", "held", held)
    return f"""/* {origin} */
#include "wheel.h"

{definitions(program, start)}"""
