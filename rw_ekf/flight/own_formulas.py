"""Formulas of a user's own as plain functions: what the filter runs as a program, written out step by step.

Each step of a program becomes the call that `formula_value` makes for it, with the same arguments in the same order, so
that the functions have its bits; and they are printed as every other function is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from rw_ekf.checking.formula import QUANTITIES, TWO_ARGUMENTS
from rw_ekf.model import formula_program
from rw_ekf.model.formula_program import CODES, formula_value
from rw_ekf.model.law import FORMULA
from rw_ekf.wheel.effect_table import EffectTable

FORMULA_BOUNDS = {"int(abs(exponent))": 8}  # of the loop of `power_of`, which no larger exponent comes to
_NAMES = {code: name for name, code in CODES.items()}
_NONE = "0.0"  # a slope that `moved` makes of nothing, whatever the derivative is
_OF_TWO = {*"+-*/", "**", *TWO_ARGUMENTS}
_SIGNS = ("+", "-", "*", "/", "**")


def formulas_instead(table: EffectTable | None) -> dict[Callable[..., Any], Callable[..., Any]]:
    """What is printed in place of the run of a program: a choice among the formulas of a table by their places.

    Empty where there are none.
    """
    if table is None:
        return {}
    places = [
        (int(start), int(count))
        for start, count, over in zip(table.law_start, table.law_count, table.law_over, strict=True)
        if over == FORMULA
    ]
    if not places:
        return {}
    given: dict[str, Any] = {}
    lines = ["def own_formula(values, start, count, at):", '    """(value, slope by omega) of one of the formulas."""']
    for number, (start, count) in enumerate(places, start=1):
        name = f"own_formula_{number}"
        given[name] = _written_out(table.law_values[start : start + count].tolist(), name)
        choice = f"    if start == {start}:\n    " if number < len(places) else ""
        lines.append(f"{choice}    return {name}(at)")
    return {formula_value: _made("\n".join(lines), "own_formula", given)}


def _written_out(program: Sequence[float], name: str) -> Callable[..., Any]:
    """A function of the moment that does what a program does; what it is, in infix, is its docstring."""
    stack: list[tuple[str, str, str]] = []  # value, slope by omega, text
    lines: list[str] = []
    step = 0
    while step < len(program):
        op = _NAMES[int(program[step])]
        step += 1
        if op == "number":
            stack.append((_literal(program[step]), _NONE, _literal(program[step])))
            step += 1
        elif op in QUANTITIES:
            stack.append((f"at.{op}", "1.0" if op == "omega" else _NONE, op))
        elif op == "swap":
            stack[-1], stack[-2] = stack[-2], stack[-1]
        else:
            count = 2 if op in _OF_TWO else 1
            parts, stack = stack[-count:], stack[:-count]
            stack.append(_call(op, parts, lines))
    value, slope, text = stack[-1]
    stated = f'    """{text[1:-1] if _is_wrapped(text) else text}, and its slope by omega."""'
    return _made("\n".join([f"def {name}(at):", stated, *lines, f"    return {value}, {slope}"]), name, {})


def _call(op: str, parts: Sequence[tuple[str, str, str]], lines: list[str]) -> tuple[str, str, str]:
    """Add the lines of one operation; what it leaves on the stack."""
    number = 1 + sum("known(" in line for line in lines)
    value, slope = f"value_{number}", f"slope_{number}"
    values, slopes, texts = zip(*parts, strict=True)
    stated = f"{values[0]} {op} {values[1]}" if op in _SIGNS else f"{op}({', '.join(values)})"
    if len(parts) == 2:
        lines.append(f"    found, of_x, of_y = two_arguments({CODES[op]}, {values[0]}, {values[1]})  # {stated}")
    else:
        lines.append(f"    found, of_x = one_argument({CODES[op]}, {values[0]})  # {stated}")
    moves = [_NONE if by == _NONE else f"moved({of}, {by})" for of, by in zip(("of_x", "of_y"), slopes, strict=False)]
    lines.append(f"    {value} = known(found)")
    if set(moves) == {_NONE}:
        slope = _NONE
    else:
        lines.append(f"    {slope} = {' + '.join(moves)}")
    text = f"({texts[0]} {op} {texts[1]})" if op in _SIGNS else f"{op}({', '.join(texts)})"
    return value, slope, text


def _literal(value: float) -> str:
    """A number; what has no value has its name."""
    return "math.nan" if math.isnan(value) else repr(float(value))


def _is_wrapped(text: str) -> bool:
    """Whether the first bracket closes with the last."""
    depth = 0
    for place, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if depth == 0:
            return place == len(text) - 1 and place > 0
    return False


def _made(source: str, name: str, given: dict[str, Any]) -> Callable[..., Any]:
    """A function of a text, as if it stood among those that run programs, with its text for the printers."""
    namespace: dict[str, Any] = {**vars(formula_program), **given}
    exec(source, namespace)
    made: Callable[..., Any] = namespace[name]
    vars(made)["source"] = source
    return made
