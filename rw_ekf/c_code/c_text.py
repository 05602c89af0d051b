"""The text of a printed program: its constants, structures and functions."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from rw_ekf.c_code.c_expressions import c_name
from rw_ekf.c_code.c_program import Printed, Program
from rw_ekf.c_code.c_types import Array, Scalar, Struct, c_type

_VALUES_IN_LINE = 4


def _public(program: Program) -> list[Printed]:
    return [found for found in program.reached() if found.public]


def public_structures(program: Program) -> str:
    """The structures that functions for others take and give."""
    needed = _structures_of(_public(program))
    return "".join(_structure(program, name) for name in program.structs if name in needed)


def prototypes(program: Program) -> str:
    """The functions for others."""
    return "\n".join("\n".join([*found.comment, f"{found.head};\n"]) for found in _public(program))


def definitions(program: Program, start: str, extra: str = "") -> str:
    """All that a program is made of but what its header has; start: functions that fill its memory.

    extra: text that comes behind it, for what it names.
    """
    functions = program.reached()
    text = "\n".join("\n".join(found.lines) for found in functions)
    tables = "".join(
        f"static const {numbers(program, name, value, of)}\n"
        for name, value, of in program.arrays.values()
        if isinstance(of, Array) and re.search(rf"\b{name}\b", text)
    )
    inner = program.structs.keys() - _structures_of(_public(program))
    views = "".join(of.definition for of in program.views.values())
    wanted = [name for name in program.structs if re.search(rf"\b{name}\b", text + extra)]
    named = {of for name in wanted for of in _within(program.structs[name][0])}
    structures = views + "".join(_structure(program, name) for name in program.structs if name in inner & named)
    builtins = "\n".join(body for name, body in program.builtins.items() if f"{name}(" in text)
    macros = "".join(
        f"#define {name} {code}{f'  /* {comment} */' if comment else ''}\n"
        for name, (code, comment) in sorted(program.macros.items())
        if re.search(rf"\b{name}\b", text)
    )
    return f"""#include <math.h>

{macros}
{structures}{tables}
{builtins}
{start}
{text}"""


def _structures_of(functions: list[Printed]) -> set[str]:
    found: set[str] = set()
    for function in functions:
        for of in (function.result, *(of for _, of in function.parameters)):
            found |= _within(of)
    return found


def _within(of: Any) -> set[str]:
    """Names of a structure and of those in it."""
    found = {of.name} if hasattr(of, "name") and not isinstance(of, Scalar) else set()
    return found.union(*(_within(member) for _, member in of.members)) if isinstance(of, Struct) else found


def _structure(program: Program, name: str) -> str:
    found, comments = program.structs[name]
    lines = []
    for member, of in found.members:
        if isinstance(of, Array):
            text = of.declared(c_name(member)) if of.elsewhere else of.embedded(c_name(member))
        else:
            text = f"{c_type(of)} {c_name(member)}"
        comment = comments.get(member, "")
        lines.append(f"    {text};{f'  /* {comment} */' if comment else ''}\n")
    return f"struct {name} {{\n{''.join(lines)}}};\n\n"


def numbers(program: Program, name: str, value: Any, of: Array) -> str:
    """An array of constants with its numbers."""
    flat = [program.number(number, of.item).code for number in np.asarray(value).reshape(-1).tolist()]
    if len(of.shape) == 2:
        rows = [flat[i : i + of.shape[1]] for i in range(0, len(flat), of.shape[1])]
        inner = ",\n".join(f"    {{{', '.join(row)}}}" for row in rows)
    else:
        rows = [flat[i : i + _VALUES_IN_LINE] for i in range(0, len(flat), _VALUES_IN_LINE)]
        inner = ",\n".join("    " + ", ".join(row) for row in rows)
    return f"{of.embedded(name)} = {{\n{inner}\n}};"
