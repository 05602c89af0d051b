"""Types and values of the printed C: what is known of an expression, and how a constant is written."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

ATOM, UNARY, PRODUCT, SUM, RELATION, LOGIC, CHOICE = 16, 14, 12, 11, 10, 5, 3  # how tightly an expression binds

_WIDTH = {"bool": 0, "int": 1, "real": 2, "clock": 3}
_FLOAT_MOST, _FLOAT_LEAST = float(np.finfo(np.float32).max), float(np.finfo(np.float32).tiny)


class NotPrintableError(Exception):
    """A construct of Python that has no place in the printed C; its text says what and where."""


@dataclass(frozen=True)
class Scalar:
    """bool, int, real (float or double) or clock (always double)."""

    name: str

    @property
    def c(self) -> str:
        """As C spells it."""
        return {"bool": "bool", "int": "int", "real": "rw_real", "clock": "double"}[self.name]


BOOL, INT, REAL, CLOCK = Scalar("bool"), Scalar("int"), Scalar("real"), Scalar("clock")


@dataclass(frozen=True)
class Array:
    """A row or a matrix of known size."""

    item: Scalar
    shape: tuple[int, ...]
    fixed: bool = False  # a constant of the program
    elsewhere: bool = False  # structures point to it

    @property
    def row(self) -> Array | Scalar:
        """What an index gives."""
        return self.item if len(self.shape) == 1 else replace(self, shape=self.shape[1:])

    def declared(self, name: str) -> str:
        """A parameter or a local variable: a pointer."""
        prefix, star = "const " if self.fixed else "", "*restrict " if self.elsewhere else "*"
        if len(self.shape) == 1:
            return f"{prefix}{self.item.c} {star}{name}"
        return f"{prefix}{self.item.c} ({star}{name}){''.join(f'[{n}]' for n in self.shape[1:])}"

    def embedded(self, name: str) -> str:
        """A member or a global: the array itself."""
        return f"{self.item.c} {name}{''.join(f'[{n}]' for n in self.shape)}"


@dataclass(frozen=True)
class View:
    """A row, a matrix or a stack of matrices whose size is known only as the program runs: where it lies, how large."""

    item: Scalar
    stored: str  # as C spells what lies in memory
    axes: int

    @property
    def name(self) -> str:
        """Of the structure: `at`, and `n0` to `n2`."""
        return f"rw_{self.stored}_{self.axes}"

    @property
    def definition(self) -> str:
        """Of the structure."""
        sizes = ", ".join(f"n{axis}" for axis in range(self.axes))
        return f"struct {self.name} {{\n    {self.stored} *at;\n    long {sizes};\n}};\n\n"

    def element(self, code: str, indices: list[str]) -> str:
        """The element, or where the row or matrix of these indices begins."""
        place = ""
        for axis, index in enumerate(indices):
            place = f"({place}) * {code}.n{axis} + {index}" if place else index if self.axes == 1 else f"(long){index}"
        for axis in range(len(indices), self.axes):
            place = f"({place}) * {code}.n{axis}"
        return f"{code}.at[{place}]" if len(indices) == self.axes else f"{code}.at + {place}"

    def part(self, code: str, indices: list[str]) -> tuple[str, View]:
        """The row or matrix of these first indices."""
        rest = View(self.item, self.stored, self.axes - len(indices))
        sizes = ", ".join(f"{code}.n{axis}" for axis in range(len(indices), self.axes))
        return f"(struct {rest.name}){{{self.element(code, indices)}, {sizes}}}", rest


@dataclass(frozen=True)
class Struct:
    """A named tuple, or a tuple of parts of different types."""

    name: str
    members: tuple[tuple[str, Type], ...]

    @property
    def held(self) -> bool:
        """Whether it holds arrays, and so is handed over by its address."""
        return any(isinstance(of, Array | View) or (isinstance(of, Struct) and of.held) for _, of in self.members)

    def member(self, name: str) -> Type:
        """Its type."""
        return dict(self.members)[name]


@dataclass(frozen=True)
class Row:
    """A tuple of numbers, which may be indexed."""

    count: int

    @property
    def name(self) -> str:
        """Of the structure that holds them."""
        return f"rw_real_{self.count}"


Type = Scalar | Array | View | Struct | Row
_NONE_KNOWN: Any = object()


@dataclass(frozen=True)
class Value:
    """An expression: its C, its type, how tightly it binds, and what it is where that is known as the C is printed."""

    code: str
    type: Type | None  # None: of a constant that has no C, as a table or a function
    binds: int = ATOM
    known: Any = _NONE_KNOWN
    domain: frozenset[int] | None = None  # all values that an int can have
    by_address: bool = False  # the code is a pointer to a structure

    @property
    def is_known(self) -> bool:
        """Whether it is a constant of the program."""
        return self.known is not _NONE_KNOWN

    def within(self, binds: int) -> str:
        """Its C as a part of something that binds so tightly."""
        return self.code if self.binds > binds else f"({self.code})"

    @property
    def possible(self) -> frozenset[int] | None:
        """All values of an int, where they are known."""
        if self.is_known and isinstance(self.known, int) and not isinstance(self.known, bool):
            return frozenset({self.known})
        return self.domain


@dataclass(frozen=True)
class Bound:
    """A function with its first arguments, as functools.partial has it."""

    function: Any
    given: tuple[Value, ...]


def c_type(of: Type) -> str:
    """A type by itself: of a result, or of a structure that is handed over whole."""
    if isinstance(of, Scalar):
        return of.c
    if isinstance(of, Array):
        raise NotPrintableError("an array is no result of a function")
    return f"struct {of.name}"


def declared(of: Type, name: str, *, parameter: bool = False) -> str:
    """A parameter, or a local variable."""
    if isinstance(of, Array):
        return of.declared(name)
    if isinstance(of, Struct) and of.held:
        return f"struct {of.name} *{name}"
    start = " = 0" if isinstance(of, Scalar) and not parameter else ""
    if of == BOOL:
        start = start.replace("0", "false")
    return f"{c_type(of)} {name}{start}"


def wider(one: Type | None, other: Type | None) -> Type:
    """The type that holds both."""
    if one is None or other is None:
        found = other if one is None else one
        assert found is not None
        return found
    if isinstance(one, Scalar) and isinstance(other, Scalar):
        return one if _WIDTH[one.name] >= _WIDTH[other.name] else other
    if isinstance(one, Array) and isinstance(other, Array) and (one.item, one.shape) == (other.item, other.shape):
        return one if one.fixed else other
    if isinstance(one, Struct) and isinstance(other, Struct) and one.name.startswith("rw_parts"):
        return one
    if one != other:
        raise NotPrintableError(f"a variable is {one} and {other}")
    return one


def number(value: float | bool, of: Scalar, *, single: bool) -> Value:
    """A number as C has it; in single precision none is larger or smaller than it can be."""
    if of == BOOL:
        return Value("true" if value else "false", BOOL, ATOM, bool(value))
    if of == INT:
        return Value(str(int(value)), INT, ATOM if value >= 0 else UNARY, int(value))
    if math.isnan(value):
        return Value("NAN", of, ATOM, value)
    if math.isinf(value):
        return Value("INFINITY" if value > 0.0 else "-INFINITY", of, ATOM if value > 0.0 else UNARY, value)
    text = repr(float(value))
    if single and of == REAL:
        size = abs(value)
        if size != 0.0:
            size = min(max(size, _FLOAT_LEAST), _FLOAT_MOST)
        text = ("-" if value < 0.0 else "") + str(np.float32(size))
        text = text if any(mark in text for mark in ".e") else f"{text}.0"
        text += "F"
    return Value(text, of, UNARY if value < 0.0 else ATOM, float(value))


def converted(value: Value, to: Type, *, single: bool) -> Value:
    """The same as another scalar; whatever is no scalar stays."""
    if not (isinstance(to, Scalar) and isinstance(value.type, Scalar)) or value.type == to:
        return value
    if value.is_known and not value.code.isupper() and isinstance(value.known, (int, float)):
        return number(value.known, to, single=single)
    if not single and {value.type.name, to.name} == {"real", "clock"}:
        return replace(value, type=to)
    return Value(f"({to.c}){value.within(UNARY - 1)}", to, UNARY, value.known, value.domain)


def is_constant_structure(value: Any) -> bool:
    """Whether a thing that is known is a named tuple."""
    return isinstance(value, tuple) and hasattr(value, "_fields")
