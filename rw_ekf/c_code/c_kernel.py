"""One function of Python as a library of C with a single entry, for arguments of the types of an example."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any

from rw_ekf.c_code.c_expressions import c_name
from rw_ekf.c_code.c_library import ENTRY
from rw_ekf.c_code.c_program import Program
from rw_ekf.c_code.c_text import definitions
from rw_ekf.c_code.c_types import ATOM, UNARY, Struct, Type, Value, c_type

_HEAD = """#include <math.h>
#include <stdbool.h>
#include <stdint.h>

typedef double rw_real;
"""


def kernel_text(
    function: Callable[..., Any], example: Sequence[Any], given_bytes: int, result_bytes: int, *, sizes_known: bool
) -> str:
    """C of `void rw_run(struct rw_given *given, T *result)`, with the arguments one behind the other in `given`.

    An argument that is None in the example is None in every call: what depends on it is left out. With sizes_known a
    row or a matrix of numbers that is not empty in the example has its size in every call. The bytes are those of the
    structures as the caller packs them. Raises NotPrintableError for what has no C.
    """
    program = Program(
        single=False, clocks=frozenset(), bounds={}, whiles={}, domains={}, by_flags=True, bounded=False,
        sizes_known=sizes_known,
    )  # fmt: skip
    members: list[tuple[str, Type]] = []
    given: list[Value] = []
    for name, value in zip(inspect.signature(function).parameters, example, strict=True):
        if value is None:
            given.append(Value("", None, ATOM, None))
            continue
        of = program.type_of(value)
        members.append((name, of))
        code, held = f"given->{c_name(name)}", isinstance(of, Struct) and of.held
        given.append(Value(f"&{code}" if held else code, of, UNARY if held else ATOM, by_address=held))
    program.structs["rw_given"] = (Struct("rw_given", tuple(members)), {})
    found, arguments = program.entry_of(function, given)
    call = f"{found.name}({', '.join(value.code for value in arguments)});"
    result = "char" if found.result is None else c_type(found.result)
    lines = [
        f'_Static_assert(sizeof(struct rw_given) == {given_bytes}, "arguments");',
        *([] if found.result is None else [f'_Static_assert(sizeof({result}) == {result_bytes}, "result");']),
        "",
        f"void {ENTRY}(struct rw_given *given, {result} *result)",
        "{",
        f"    {'(void)result;' if found.result is None else '*result ='}",
        f"    {call}",
        "}",
    ]
    return _HEAD + definitions(program, "", extra="rw_given") + "\n".join(lines) + "\n"
