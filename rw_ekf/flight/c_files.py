"""rw_ekf.h and rw_ekf.c: the printed program with its memory, its constants and where it starts from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rw_ekf.c_code.c_program import Program
from rw_ekf.c_code.c_text import definitions, numbers, prototypes, public_structures
from rw_ekf.c_code.c_types import ATOM, INT, Array, Scalar, Struct, Value
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.flight import onboard
from rw_ekf.flight.onboard_compensation import Crossing, crossing_of, current_by_crossing, current_by_dmc
from rw_ekf.flight.own_formulas import FORMULA_BOUNDS, formulas_instead
from rw_ekf.wheel.effect_table import EffectTable

_CLOCKS = frozenset({"last_s", "acts_s", "health"})  # single precision would stop these within days
_BOUNDS = {"stop": onboard.PIECES_MOST, "count": onboard.PIECES_MOST, **FORMULA_BOUNDS}
# One turn a piece; a piece is one step, for no effect that is exported has a lag.
# Steps that double from 1e-9 rad/s over a slope until 1e3 A are passed, whatever the slope is.
_WHILES = {"effect_interval": (onboard.PIECES_MOST, onboard.PIECES_MOST, 1), "inverted": (128, 128)}


@dataclass(frozen=True)
class Estimator:
    """What is printed: a start, the constants of the filter, the effects."""

    held: onboard.Onboard
    constants: FilterConstants
    table: EffectTable | None
    names: tuple[str, ...]  # of the states

    @property
    def crossing(self) -> Crossing:
        """What predictive crossing begins with."""
        return crossing_of(self.held)

    @property
    def size(self) -> int:
        """Number of states."""
        return self.held.x.size


def printed(estimator: Estimator, *, single: bool) -> Program:
    """The program; raises NotPrintableError for what has no C."""
    laws = {estimator.constants.stribeck.law}
    if estimator.table is not None and estimator.table.stribeck_at >= 0:
        laws.add(estimator.table.stribeck_law)
    domains = {"law": frozenset(laws)}
    instead = formulas_instead(estimator.table)
    program = Program(single=single, clocks=_CLOCKS, bounds=_BOUNDS, whiles=_WHILES, domains=domains, instead=instead)
    held = Value("held", program.hold(estimator.held), by_address=True)
    constants, table = estimator.constants, estimator.table
    program.name_known(constants, "filter")
    program.name_known(constants.stribeck, "stribeck")
    if table is not None:
        program.name_known(table, "effects")
    known = [program.of_known(constants, ""), Value("", None, ATOM, table)]
    reading = Value("reading", program.structure(onboard.Reading))
    relative = Value("", None, ATOM, single)
    amount = Value("", Scalar("real"))
    program.entry(onboard.take_reading, "rw_ekf_step", [held, *known, reading, relative])
    program.entry(onboard.take_command, "rw_ekf_command", [held, amount, amount])
    crossing = Value("crossing", program.hold(estimator.crossing), by_address=True)
    program.entry(current_by_dmc, "rw_ekf_dmc_current", [held, *known, amount, relative])
    program.entry(current_by_crossing, "rw_ekf_crossing_current", [crossing, held, *known, amount, amount, relative])
    program.entry(onboard.sigma, "rw_ekf_std", [held, Value("", INT)])
    return program


def header(program: Program, estimator: Estimator, origin: str) -> str:
    """rw_ekf.h."""
    states = "\n".join(f"#define RW_EKF_{name.upper()} {i}" for i, name in enumerate(estimator.names))
    return f"""/* {origin} */
#ifndef RW_EKF_H
#define RW_EKF_H

#include <stdbool.h>

typedef {"float" if program.single else "double"} rw_real;

#define RW_EKF_STATES {estimator.size}

/* Places in `x`, and in the rows and columns of `P`. */
{states}

{public_structures(program)}
/* Begin; before anything else, and again to begin anew. */
void rw_ekf_start(struct rw_onboard *held);

/* Begin predictive crossing; once, before its first current. */
void rw_ekf_crossing_start(struct rw_crossing *crossing);

{prototypes(program)}
#endif
"""


def source(program: Program, estimator: Estimator, origin: str) -> str:
    """rw_ekf.c."""
    start = start_of(program, "rw_ekf_start", "held", estimator.held)
    start += "\n" + start_of(program, "rw_ekf_crossing_start", "crossing", estimator.crossing)
    return f"""/* {origin} */
#include "rw_ekf.h"

{definitions(program, start)}"""


def start_of(program: Program, name: str, argument: str, example: Any) -> str:
    """A function that makes all that is held what it is in an example."""
    tables: list[str] = []
    lines: list[str] = []

    def fill(struct: Struct, value: Any, path: str, label: str) -> None:
        for (member, of), part in zip(struct.members, value, strict=True):
            if isinstance(of, Struct):
                fill(of, part, f"{path}{member}.", f"{label}_{member}")
                continue
            assert isinstance(of, Array)
            indent, index = "    ", ""
            for axis, count in enumerate(of.shape):
                counter = "ij"[axis]
                lines.append(f"{indent}for (int {counter} = 0; {counter} < {count}; ++{counter}) {{")
                indent, index = indent + "    ", f"{index}[{counter}]"
            begins = program.number(0, of.item).code
            if np.any(np.asarray(part) != 0.0):
                tables.append(f"static const {numbers(program, f'{label}_{member}', part, of)}\n")
                begins = f"{label}_{member}{index}"
            lines.append(f"{indent}{argument}->{path}{member}{index} = {begins};")
            lines.extend("    " * (axis + 1) + "}" for axis in reversed(range(len(of.shape))))

    struct = program.hold(example)
    fill(struct, example, "", "start")
    return "\n".join([*tables, f"void {name}(struct {struct.name} *{argument})", "{", *lines, "}", ""])
