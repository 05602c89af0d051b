"""A program in C: the functions that one function of Python calls, each for the types that it is called with."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from rw_ekf.c_code.c_expressions import c_name
from rw_ekf.c_code.c_names import Names
from rw_ekf.c_code.c_statements import Body
from rw_ekf.c_code.c_stores import assigned_names
from rw_ekf.c_code.c_types import (
    ATOM,
    BOOL,
    CLOCK,
    INT,
    REAL,
    Array,
    Bound,
    NotPrintableError,
    Scalar,
    Struct,
    Type,
    Value,
    c_type,
    declared,
)
from rw_ekf.c_code.python_source import source_of

_PASSES = 8


@dataclass
class Printed:
    """A function in C."""

    name: str
    result: Type | None
    parameters: list[tuple[str, Type]]
    comment: list[str] = field(default_factory=list)
    body: list[str] = field(default_factory=list)
    cost: int = 0  # statements that it runs at most, with those that it calls
    public: bool = False
    inline: bool = False  # of a loop over a log, in which a call costs as much as what is called
    calls: list[Printed] = field(default_factory=list)

    @property
    def lines(self) -> list[str]:
        """Its definition."""
        return [*self.comment, self.head, *self.body]

    @property
    def head(self) -> str:
        """Its declaration, without a semicolon."""
        given = ", ".join(declared(of, c_name(name), parameter=True) for name, of in self.parameters) or "void"
        result = "void" if self.result is None else c_type(self.result)
        scope = "" if self.public else "static inline " if self.inline else "static "
        return f"{scope}{result} {self.name}({given})"


class Program(Names):
    """A program in C: its functions, and the bounds of their loops."""

    def __init__(
        self, *, single: bool, clocks: frozenset[str], bounds: Mapping[str, int], whiles: Mapping[str, tuple[int, ...]],
        domains: Mapping[str, frozenset[int]], by_flags: bool = False, bounded: bool = True, sizes_known: bool = True,
        instead: Mapping[Callable[..., Any], Callable[..., Any]] | None = None,
    ) -> None:  # fmt: skip
        """bounds: of loops that end at a variable. whiles: turns of each `while` of a function at most, in order.

        bounded: no loop turns more often than is known, and structures have room for arrays (`Names`).

        instead: what is printed in place of a function.
        by_flags: a function that is called with a flag that is known is printed for that flag alone. The rest as
        `Names` has it.
        """
        super().__init__(
            single=single, clocks=clocks, domains=domains, holds_arrays=bounded, sizes_known=sizes_known
        )  # fmt: skip
        self.bounded = bounded
        self.cost = 0
        self.functions: list[Printed] = []
        self.entries: list[Printed] = []  # that are called from without
        self._bounds, self._whiles = bounds, whiles
        self._instead = {} if instead is None else instead
        self._settled = (None, INT, BOOL) if by_flags else (None, INT)  # types of arguments that need no parameter
        self._made: dict[Any, Printed | None] = {}
        self._calls: list[list[Printed]] = []

    # Loops.

    def bound_of(self, name: str) -> int | None:
        """What a variable that ends a loop is at most."""
        return self._bounds.get(name)

    def bound_of_while(self, function: Callable[..., Any], which: int) -> int:
        """How often a loop turns at most."""
        turns = self._whiles.get(function.__name__, ())
        if which >= len(turns):
            raise NotPrintableError(f"{function.__qualname__}: no bound of its loop number {which + 1} is known")
        return turns[which]

    # Functions.

    def called(self, function: Callable[..., Any], given: list[Value], named: dict[str, Value]) -> Value:
        """A call; the function is printed for these types, and for what is known of its arguments."""
        found, runtime = self._for_call(self._instead.get(function, function), given, named)
        self.cost += found.cost + 1
        self._calls[-1].append(found)
        codes = [self.convert(value, of).code for value, (_, of) in zip(runtime, found.parameters, strict=True)]
        return Value(f"{found.name}({', '.join(codes)})", found.result)

    def entry(self, function: Callable[..., Any], name: str, arguments: list[Value]) -> Printed:
        """A function that others call, under a name."""
        found, _ = self.entry_of(function, arguments)
        found.name, found.public = name, True
        return found

    def entry_of(self, function: Callable[..., Any], arguments: list[Value]) -> tuple[Printed, list[Value]]:
        """A function that the text around the program calls, and those of the arguments that it takes."""
        found, runtime = self._for_call(function, arguments, {})
        self.entries.append(found)
        return found, runtime

    def _for_call(
        self, function: Callable[..., Any], given: list[Value], named: dict[str, Value]
    ) -> tuple[Printed, list[Value]]:
        if not inspect.isfunction(function):
            raise NotPrintableError(f"{function!r} is no function that is printed")
        signature = inspect.signature(function)
        bound = signature.bind(*given, **named)
        changed = assigned_names(source_of(function).tree)
        names: dict[str, Value] = {}
        runtime: list[Value] = []
        parameters: list[tuple[str, Type]] = []
        key: list[Any] = [function]
        for name, parameter in signature.parameters.items():
            value = bound.arguments.get(name)
            value = self.of_known(parameter.default, name) if value is None else value
            value = self._as_annotated(value, str(parameter.annotation))
            if isinstance(value.known, Bound):
                parts = [self._bound_part(f"{name}_{i}", part) for i, part in enumerate(value.known.given)]
                names[name] = Value("", None, ATOM, Bound(value.known.function, tuple(parts)))
                open_parts = [(of, part) for of, part in zip(parts, value.known.given, strict=True) if part.type]
                parameters += [(of.code, part.type) for of, part in open_parts if part.type is not None]
                runtime += [part for _, part in open_parts]
                key.append((name, value.known.function, tuple((of.code, of.type, id(of.known)) for of in parts)))
                continue
            if value.is_known and value.type in self._settled and name not in changed:
                names[name] = value
                key.append((name, id(value.known) if value.type is None else value.known))
                continue
            value = self.whole(value)
            of = value.type
            assert of is not None
            if isinstance(of, Array) and of.fixed and len(of.shape) == 1 and value.code.isidentifier():
                known = self._fixed(value)
                if known is not None:
                    names[name] = value
                    key.append((name, id(known)))
                    continue
            domain = value.possible if of == INT and name not in changed else None
            names[name] = Value(c_name(name), of, domain=domain, by_address=isinstance(of, Struct) and of.held)
            parameters.append((name, of))
            runtime.append(value)
            key.append((name, of, domain))
        found = self._print(function, tuple(key), names, parameters)
        return found, runtime

    @staticmethod
    def _bound_part(name: str, part: Value) -> Value:
        """An argument that was given before, as the callee knows it."""
        return Value(name, part.type, ATOM, by_address=part.by_address) if part.type is not None else part

    def _fixed(self, value: Value) -> Any:
        return next((array for name, array, _ in self.arrays.values() if name == value.code), None)

    def _as_annotated(self, value: Value, text: str) -> Value:
        """A number as a parameter has it."""
        if isinstance(value.type, Scalar):
            if "Clock" in text:
                return self.convert(value, CLOCK)
            if "float" in text:
                return self.convert(value, REAL)
        return value

    def _print(
        self, function: Callable[..., Any], key: tuple[Any, ...], names: dict[str, Value],
        parameters: list[tuple[str, Type]],
    ) -> Printed:  # fmt: skip
        if key in self._made:
            known = self._made[key]
            if known is None:
                raise NotPrintableError(f"{function.__qualname__} calls itself")
            return known
        self._made[key] = None
        source, before = source_of(function), self.cost
        last: Body | None = None
        for _ in range(_PASSES):
            self.cost = 0
            self._calls.append([])
            body = Body(self, function, source, names, last)
            body.run()
            calls = self._calls.pop()
            if body.is_settled(last):
                break
            last = body
        else:
            raise NotPrintableError(f"{function.__qualname__}: its types do not settle")
        name, inline = self._name_of(function), self.sizes_known and not self.bounded
        found = Printed(name, body.result, parameters, cost=self.cost, inline=inline, calls=calls)
        unused = [f"    (void){c_name(name)};" for name, _ in parameters if name not in body.scope.used]
        found.comment = _comment(source.docstring)
        found.body = ["{", *unused, *body.declarations(), *body.lines, "}", ""]
        self._made[key] = found
        self.functions.append(found)
        self.cost = before
        return found

    def reached(self) -> list[Printed]:
        """The functions that are called from without, and those that they call; each behind those that it calls."""
        ahead = [*self.entries]
        names: set[int] = set()
        while ahead:
            found = ahead.pop()
            if id(found) not in names:
                names.add(id(found))
                ahead += found.calls
        return [found for found in self.functions if id(found) in names]

    def _name_of(self, function: Callable[..., Any]) -> str:
        module = function.__module__.rpartition(".")[2]
        own = function.__name__.lstrip("_")
        name = own if own.startswith(module) else f"{module}_{own}"
        taken = {found.name for found in self.functions}
        count = 1
        label = name
        while label in taken:
            count += 1
            label = f"{name}_{count}"
        return label


def _comment(text: str) -> list[str]:
    """A docstring as a comment of C."""
    if not text:
        return []
    lines = [line for part in text.replace("*/", "* /").split("\n") for line in textwrap.wrap(part, 112) or [""]]
    return (
        [f"/* {lines[0]}", *(f" * {line}".rstrip() for line in lines[1:]), " */"]
        if len(lines) > 1
        else [f"/* {lines[0]} */"]
    )
