"""A model's wheel as one MATLAB function: the next speed after an interval of constant current."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.c_code.c_types import NotPrintableError
from rw_ekf.errors import BadInputError
from rw_ekf.flight.matlab_functions import SMALL_FUNCTIONS, Functions, number
from rw_ekf.flight.own_formulas import formulas_instead
from rw_ekf.flight.plant_model import PlantModel
from rw_ekf.logs.atomic import write_text
from rw_ekf.model import flow, formula_program, law
from rw_ekf.model.effect import REFERENCE_DEGC, Term
from rw_ekf.model.effect_kinds import DelayEffect, FormulaEffect, StaticEffect, WindowEffect
from rw_ekf.model.friction import friction
from rw_ekf.model.law import KINDS, MOST_COLUMNS, sums_of
from rw_ekf.version import __version__
from rw_ekf.wheel.dispatch import CURRENT_EFFECTS, MEMORY_EFFECTS
from rw_ekf.wheel.effect_table import EffectTable
from rw_ekf.wheel.pieces import _HELD, _LAG_STEPS, _LEAST_SHAPE

MATLAB_SCHEMA = "rw_ekf.export_matlab/1"
_LONGEST_NAME = 63  # of a function of MATLAB
_RESERVED = {  # as iskeyword lists them
    "break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function", "global", "if",
    "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while",
}  # fmt: skip
_AT = "[omega, amperes, state.temperature_degC, angle, at + 0.5 * h, h, state.columns]"  # a Moment
_MAIN = """function [omega_next, state_next] = NAME(omega, current, dt, p, state)
%TITLE
%
% p = NAME() is a struct of the parameters, with the state that a wheel begins with, p.state.
%
% [omega_next, state_next] = NAME(omega, current, dt, p, state) is the speed [rad/s] dt seconds after omega, under a
% constant current [A], stick and reversal included. p and state may be left out. dt is cut into parts of
% p.longest_step_s at most. The state has
%
%     time_s, angle_rad          followed on
%     temperature_degC, columns  to be set, where effects are functions of them (this model: CONDITIONS)
%     current_A                  in the winding, where it lags behind its command
%     friction_rad_s2            where friction has a memory
%
% p.friction(p, omega) is the base model's friction per inertia [rad/s^2] at speeds of any size, without effects; at 0
% the break-away friction. INERTIA
%
REMARKS
if nargin < 4
    p = parameters_();
end
if nargin == 0
    omega_next = p;
    return
end
if nargin < 5
    state = p.state;
end
parts = max(ceil(dt / p.longest_step_s - 1e-9), 1);
omega_next = omega;
state_next = state;
for part = 1:parts
    [omega_next, state_next] = interval_(omega_next, current, dt / parts, p, state_next);
end
end

function p = parameters_()
PARAMETERS
p.friction = @friction_;
p.state = struct('time_s', 0, 'angle_rad', 0, 'temperature_degC', TEMPERATURE, 'columns', [COLUMNS], ...
    'current_A', 0, 'friction_rad_s2', 0);
end

function value = friction_(p, omega)
% Base model, by sizes of the speed; signed as the speed, and above zero at rest.
OMEGA_S
value = zeros(size(omega));
for place = 1:numel(omega)
    size_of = friction_friction(abs(omega(place)), p.viscous, p.coulomb, p.static, omega_s, LAW);
    value(place) = copysign_(size_of, omega(place));
end
end

function [omega, state] = interval_(omega, current, duration, p, state)
% One interval: drive and friction with all effects, then the exact flow.
OMEGA_S
before_all = omega;
angle = state.angle_rad;
at = state.time_s;
to = at + duration;
while at < to
    left = to - at;
    h = left;
    amperes = current;
LAG    terms = zeros(1, 6);  % A, rad/s^2, 1/s, -, -, rad/s^2
TERMS    drive = p.motor_gain * (amperes + terms(1)) + terms(2);
    b = p.viscous * (1 + terms(4)) + terms(3);
    level = p.coulomb * terms(5) + terms(6);
    curve = [b, p.coulomb + level, p.static + level, omega_s, LAW];
    before = omega;
FLOW    angle = angle + 0.5 * (before + omega) * h;
    if h == left
        at = to;
    else
        at = at + h;
    end
end
state.angle_rad = state.angle_rad + 0.5 * (before_all + omega) * duration;
state.time_s = to;
end
"""


def export_matlab(model: PlantModel, path: Path) -> dict[str, Any]:
    """Write the function; what was written, as `export-model --json` has it.

    Raises BadInputError for a name that MATLAB does not take, an effect that has no MATLAB, or a file that cannot be
    written.
    """
    name = path.stem
    if not re.fullmatch(r"[A-Za-z]\w*", name, flags=re.ASCII) or len(name) > _LONGEST_NAME:
        raise BadInputError(
            f"{path}: MATLAB calls a function as its file, and takes letters, digits and _ after a letter, "
            f"{_LONGEST_NAME} at most: give another name"
        )
    if name in _RESERVED:
        raise BadInputError(
            f"{path}: MATLAB calls a function as its file, and '{name}' is a word of its language: give another name"
        )
    write_text(path, matlab_text(model, name))
    return {
        "schema": MATLAB_SCHEMA,
        "model": model.name,
        "out": str(path),
        "call": f"[omega_next, state_next] = {name}(omega, current, dt, p, state)",
        "parameters": list(model.state_names),
        "longest_step_s": model.period_s,
        "remarks": remarks_of(model),
    }


def remarks_of(model: PlantModel) -> list[str]:
    """What is not in it, and what a user must know: sentences without a stop."""
    found = []
    for term in model.effects.state_terms:
        if issubclass(term.effect, DelayEffect):
            found.append(f"{term.id} is not in it: delay the current by {term.values[0]:.6g} s before the call")
        if issubclass(term.effect, WindowEffect):
            found.append(
                f"{term.id} is not in it: omega is the wheel's own speed, of which readings are means over "
                f"{term.values[0]:.6g} s"
            )
    return [*found, *(remark for remark in model.remarks if "mean over a window" not in remark)]


def matlab_text(model: PlantModel, name: str) -> str:
    """The file. Raises BadInputError for an effect that has no MATLAB."""
    functions = Functions(formulas_instead(model.table))
    try:
        parts = {
            "FLOW": _flow(model, functions),
            "TERMS": "".join(_terms(model, functions)),
            "LAG": _lag(model, functions),
        }
        functions.name_of(friction)
    except NotPrintableError as error:
        raise BadInputError(f"{model.name}: cannot be exported as MATLAB: {error}") from None
    table = model.table
    base = number(float(model.stribeck.omega_s))
    omega_s = "omega_s = p.stribeck_speed_rad_s;"
    if table.stribeck_at >= 0:
        omega_s = f"omega_s = max(p.{_state(model, table.stribeck_at)}, {_LEAST_SHAPE!r} * p.stribeck_speed_rad_s);"
    columns = [column.start for column in model.columns]
    columns += [0.0] * (MOST_COLUMNS - len(columns))
    conditions = ["temperature_degC"] * model.has_temperature
    conditions += [f"columns({slot}) is {column.name}" for slot, column in enumerate(model.columns, start=1)]
    parameters = [f"p.{n} = {number(float(v))};" for n, v in zip(model.state_names, model.x[1:].tolist(), strict=False)]
    parameters += [f"p.stribeck_speed_rad_s = {base};", f"p.longest_step_s = {number(model.period_s)};"]
    inertia = "Nobody gave the wheel's inertia."
    if model.inertia_kg_m2 is not None:
        parameters.append(f"p.inertia_kg_m2 = {number(float(model.inertia_kg_m2))};")
        inertia = "Times p.inertia_kg_m2 it is a torque [N m]."
    parts |= {
        "TITLE": f"{name.upper()} Reaction wheel of the model {model.name}, printed by rw_ekf {__version__}.",
        "CONDITIONS": ", ".join(conditions) or "none",
        "INERTIA": inertia,
        "REMARKS": "\n".join(f"% {remark}." for remark in remarks_of(model)),
        "PARAMETERS": "\n".join([*parameters, *_laws(model)]),
        "TEMPERATURE": number(REFERENCE_DEGC),
        "COLUMNS": ", ".join(map(number, columns)),
        "OMEGA_S": omega_s,
        "LAW": str(_law_code(model)),
        "NAME": name,
    }
    text = re.sub(rf"\b({'|'.join(parts)})\b", lambda found: parts[found[1]], _MAIN)
    return f"{text}\n{functions.text}\n{SMALL_FUNCTIONS}"


def _state(model: PlantModel, at: int) -> str:
    """The field of a parameter by its place in the state."""
    return model.state_names[at - 1]


def _shape(term: Term, component: int = 0) -> str:
    return ", ".join(number(float(q)) for q in term.effect.component_shape(term.shape, component))


def _placed(model: PlantModel) -> list[tuple[Term, int, str]]:
    """Every coefficient: its term, its number in the term, its field."""
    fields = iter(model.effects.state_names)
    return [(term, i, next(fields)) for term in model.effects.state_terms for i in range(len(term.values))]


def _terms(model: PlantModel, functions: Functions) -> list[str]:
    """Lines that add the static effects' contributions to a step, then the learned laws', as `wheel.pieces` does."""
    lines, laws, count, places = [], [], 0, iter(_formula_places(model.table))
    for term, i, field in _placed(model):
        if issubclass(term.effect, FormulaEffect):
            laws += _formula_term(term.effect, field, next(places), functions)
        elif term.law is not None:
            count += 1
            of, size, kind = f"p.law_{count}", len(term.law.functions[i]), KINDS.index(term.law.acts_as)
            place, value, contribution, motion = (
                functions.name_of(one) for one in (law.law_place, law.law_value, law.law_contribution, law.motion)
            )
            laws += [
                f"    place = {place}({size}, {of}.first, {of}.per, {term.law.over}, ...\n",
                f"        {_AT});\n",
                f"    value = p.{field} * {value}({of}.values, {of}.sums, 0, {size}, place);\n",
                f"    terms = terms + {contribution}({kind}, value(1), value(2), {motion}(omega, amperes), ...\n",
                "        omega, amperes);\n",
            ]
        elif issubclass(term.effect, StaticEffect):
            called = functions.name_of(term.effect.contribution)
            lines.append(f"    terms = terms + {called}(p.{field}, [{_shape(term, i)}], ...\n        {_AT});\n")
    return lines + laws


def _formula_places(table: EffectTable) -> list[int]:
    """Where the program of each formula begins, by which `own_formulas` distinguishes them."""
    return [int(start) for start, over in zip(table.law_start, table.law_over, strict=True) if over == law.FORMULA]


def _formula_term(effect: type[FormulaEffect], field: str, start: int, functions: Functions) -> list[str]:
    """Lines that add a formula of one's own, as `wheel.pieces` does."""
    kind = KINDS.index(effect.acts_by)
    size_of, contribution, motion = (
        functions.name_of(one) for one in (formula_program.formula_size, law.law_contribution, law.motion)
    )
    return [
        f"    along = {motion}(omega, amperes);\n",
        f"    value = p.{field} * {size_of}([], {start}, 0, along, {number(kind == law.DRAG)}, ...\n        {_AT});\n",
        f"    terms = terms + {contribution}({kind}, value(1), value(2), along, omega, amperes);\n",
    ]


def _laws(model: PlantModel) -> list[str]:
    lines: list[str] = []
    for term, i, _ in _placed(model):
        if term.law is None:
            continue
        values = np.array(term.law.functions[i], dtype=np.float64)
        per = (values.size - 1) / (term.law.last - term.law.first)
        rows = [", ".join(number(float(v)) for v in numbers) for numbers in (values, sums_of(values))]
        first = number(float(term.law.first))
        lines.append(
            f"p.law_{len(lines) + 1} = struct('first', {first}, 'per', {number(float(per))}, ..."
            f"\n    'values', [{rows[0]}], ...\n    'sums', [{rows[1]}]);"
        )
    return lines


def _law_code(model: PlantModel) -> int:
    """Of the Stribeck curve in force."""
    return int(model.table.stribeck_law if model.table.stribeck_at >= 0 else model.stribeck.law)


def _lag(model: PlantModel, functions: Functions) -> str:
    """Lines that make the current lag."""
    table = model.table
    if table.lag_at < 0:
        return ""
    called, even = (functions.name_of(one) for one in (CURRENT_EFFECTS[table.lag_code].lagged, flow.goes_evenly))
    shape = ", ".join(number(float(q)) for q in table.lag_shape)
    return f"""    tau = p.{_state(model, table.lag_at)};
    most_drive = abs(p.motor_gain) * max(abs(current), abs(state.current_A));
    curve = [p.viscous, p.coulomb, p.static, omega_s, {_law_code(model)}];
    if tau > 0 && ~{even}(omega, most_drive, curve, left)
        h = min(left, max(0.5 * tau, left / {_LAG_STEPS}));
        if at + h <= at
            h = left;
        end
    end
    lagged = {called}(tau, [{shape}], state.current_A, current, h);
    amperes = lagged(1);
    state.current_A = lagged(2);
"""


def _flow(model: PlantModel, functions: Functions) -> str:
    """Lines that move the wheel over a step."""
    table = model.table
    if table.memory_at < 0:
        return f"    omega = at_({functions.name_of(flow.flow)}(omega, drive, curve, h, false), 1);\n"
    called = functions.name_of(MEMORY_EFFECTS[table.memory_code].flow)
    shape = ", ".join(number(float(q)) for q in table.memory_shape)
    held = f"""    if abs(omega) < {_HELD} * omega_s && abs(drive) <= curve(3)
        omega = 0;
    end
"""
    return f"""{held if table.memory_holds else ""}    moved = {called}(omega, state.friction_rad_s2, drive, curve, ...
        p.{_state(model, table.memory_at)}, [{shape}], h);
    omega = moved(1);
    state.friction_rad_s2 = moved(2);
"""
