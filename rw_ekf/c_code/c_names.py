"""Types, constants and structures of a printed program, as they are needed."""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

import numpy as np

from rw_ekf.c_code.c_types import (
    ATOM,
    BOOL,
    CLOCK,
    INT,
    REAL,
    UNARY,
    Array,
    NotPrintableError,
    Row,
    Scalar,
    Struct,
    Type,
    Value,
    View,
    converted,
    is_constant_structure,
    number,
)
from rw_ekf.c_code.packing import is_sized
from rw_ekf.c_code.python_source import comment_of_constant, comments_of_members, origin_of

_BUILTINS = {
    "rw_min": "static {t} {name}({t} a, {t} b)\n{{\n    return (b < a) ? b : a;\n}}\n",
    "rw_max": "static {t} {name}({t} a, {t} b)\n{{\n    return (b > a) ? b : a;\n}}\n",
    "rw_mod": (
        "/* With the sign of b, as Python has it. */\n"
        "static {t} {name}({t} a, {t} b)\n{{\n    const {t} rest = fmod{f}(a, b);\n"
        "    if (rest == 0) {{\n        return copysign{f}(rest, b);\n    }}\n"
        "    return ((rest < 0) != (b < 0)) ? rest + b : rest;\n}}\n"
    ),
    "rw_floor_div": (
        "/* Towards minus infinity, as Python has it. */\n"
        "static {t} {name}({t} a, {t} b)\n{{\n    const {t} rest = fmod{f}(a, b);\n"
        "    const {t} whole = ((a - rest) / b) - (((rest != 0) && ((rest < 0) != (b < 0))) ? 1 : 0);\n"
        "    return (whole == 0) ? copysign{f}(0, a / b) : floor{f}(whole + 0.5{f});\n}}\n"
    ),
    # By 0, where Python raises: 0, for a processor stops the program.
    "rw_mod_int": (
        "static int {name}(int a, int b)\n{{\n    const int rest = (b == 0) ? 0 : a % b;\n"
        "    return ((rest != 0) && ((rest < 0) != (b < 0))) ? rest + b : rest;\n}}\n"
    ),
    "rw_floor_div_int": (
        "static int {name}(int a, int b)\n{{\n    const int whole = (b == 0) ? 0 : a / b;\n"
        "    return ((whole * b != a) && ((a < 0) != (b < 0))) ? whole - 1 : whole;\n}}\n"
    ),
    "rw_to_int": (
        "/* Towards zero; 0 where the number is none, or is beyond any index. */\n"
        "static int {name}({of} a)\n{{\n    return ((a > ({of})-1.0e6) && (a < ({of})1.0e6)) ? (int)a : 0;\n}}\n"
    ),
}


_ITEMS = {"f": REAL, "i": INT, "b": BOOL}


class Names:
    """What is printed so far. Constants of a model are known; what is held in memory has the types of an example."""

    def __init__(
        self, *, single: bool, clocks: frozenset[str], domains: Mapping[str, frozenset[int]], holds_arrays: bool = True,
        sizes_known: bool = True,
    ) -> None:  # fmt: skip
        """single: reals are float. clocks: members that stay double. domains: all values of members that are whole.

        holds_arrays: structures have room for their arrays, else they point to them, and the sizes of these are known
        only as the program runs; but those of the rows and matrices of numbers in an example where they are not empty
        and sizes_known says so.
        """
        self.single = single
        self.holds_arrays, self.sizes_known = holds_arrays, sizes_known
        self.views: dict[str, View] = {}
        self.domains = domains
        self.structs: dict[str, tuple[Struct, dict[str, str]]] = {}
        self.macros: dict[str, tuple[str, str]] = {}
        self.arrays: dict[int, tuple[str, Any, Type]] = {}
        self.builtins: dict[str, str] = {}
        self._clocks = clocks
        self._classes: dict[type[Any], Struct] = {}
        self._names: dict[int, str] = {}  # of known structures

    # Types.

    def number(self, value: Any, of: Scalar) -> Value:
        """A number."""
        return number(value, of, single=self.single)

    def convert(self, value: Value, to: Type) -> Value:
        """As another scalar; what is known and has no C yet gets one."""
        return converted(self.whole(value), to, single=self.single)

    def hold(self, example: Any) -> Struct:
        """The structure of a named tuple that holds arrays, and of those in it."""
        kind = type(example)
        members: list[tuple[str, Type]] = []
        for name, value in zip(kind._fields, example, strict=True):
            if not self.holds_arrays:
                members.append((name, self.type_of(value)))
            elif isinstance(value, np.ndarray):
                item = INT if value.dtype.kind == "i" else CLOCK if name in self._clocks else REAL
                members.append((name, Array(item, value.shape)))
            else:
                members.append((name, self.hold(value)))
        return self._register(kind, tuple(members))

    def type_of(self, example: Any) -> Type:
        """The type of something that is pointed to, or of numbers; raises NotPrintableError for what has no C."""
        if isinstance(example, np.ndarray):
            if is_sized(example, self.sizes_known):
                return Array(REAL, example.shape, elsewhere=True)
            stored = {"f8": "double", "i8": "int64_t", "i4": "int32_t", "i1": "int8_t", "b1": "bool"}
            found = View(_ITEMS[example.dtype.kind], stored[example.dtype.str[1:]], example.ndim)
            return self.viewed(found)
        if is_constant_structure(example):
            return self.hold(example) if _holds_arrays(example) else self.structure(type(example))
        if isinstance(example, tuple):
            return self._row(len(example))
        return BOOL if isinstance(example, bool) else INT if isinstance(example, int) else REAL

    def viewed(self, of: View) -> View:
        """A view, whose structure is then defined."""
        self.views[of.name] = of
        return of

    def structure(self, kind: type[Any]) -> Struct:
        """The structure of a named tuple of scalars."""
        if kind not in self._classes:
            texts = kind.__annotations__
            hints = typing.get_type_hints(kind)
            members = [(name, self._of_hint(texts[name], hints[name])) for name in kind._fields]
            self._register(kind, tuple(members))
        return self._classes[kind]

    def _register(self, kind: type[Any], members: tuple[tuple[str, Type], ...]) -> Struct:
        words = "".join(f"_{c.lower()}" if c.isupper() else c for c in kind.__name__).lstrip("_")
        found = self._classes[kind] = Struct(f"rw_{words}", members)
        self.structs[found.name] = found, comments_of_members(kind)
        return found

    def _of_hint(self, text: Any, hint: Any) -> Type:
        if "Clock" in str(getattr(text, "__forward_arg__", text)):
            return CLOCK
        if hint in (bool, int, float):
            return {bool: BOOL, int: INT, float: REAL}[hint]
        if typing.get_origin(hint) is tuple and set(typing.get_args(hint)) == {float}:
            return self._row(len(typing.get_args(hint)))
        if inspect.isclass(hint) and hasattr(hint, "_fields"):
            return self.structure(hint)
        raise NotPrintableError(f"a member of type {hint} has no C")

    def _row(self, count: int) -> Row:
        found = Row(count)
        self.structs.setdefault(found.name, (Struct(found.name, (("v", Array(REAL, (count,))),)), {}))
        return found

    # Values.

    def of_global(self, function: Callable[..., Any], name: str) -> Value:
        """A name of a function's module: a number gets a name in C, with its comment."""
        value = function.__globals__[name]
        if isinstance(value, (bool, int, float)) and inspect.getmodule(function) is not None:
            module, own = origin_of(function, name)
            label = f"{module.__name__.rpartition('.')[2]}_{own.lstrip('_')}".upper()
            return self._macro(label, value, comment_of_constant(module, own))
        return self.of_known(value, name)

    def _macro(self, label: str, value: Any, comment: str) -> Value:
        of = BOOL if isinstance(value, bool) else INT if isinstance(value, int) else REAL
        plain = self.number(value, of)
        code = f"({plain.code})" if plain.binds == UNARY else plain.code
        while label in self.macros and self.macros[label][0] != code:
            label += "_"
        self.macros[label] = code, comment
        return Value(label, of, ATOM, value)

    def of_known(self, value: Any, name: str) -> Value:
        """Something that is known as the C is printed."""
        if isinstance(value, (np.integer, np.floating)):
            value = value.item()
        if isinstance(value, (bool, int, float)):
            return self.number(value, BOOL if isinstance(value, bool) else INT if isinstance(value, int) else REAL)
        if isinstance(value, np.ndarray):
            return self._array(value, name)
        if is_constant_structure(value) and name:
            self._names.setdefault(id(value), name)
        return Value("", None, ATOM, value)

    def name_known(self, value: Any, name: str) -> None:
        """What the constants of a structure begin with in C."""
        self._names[id(value)] = name

    def member_of(self, known: Any, name: str) -> Value:
        """A member of what is known: of a structure of the model, a module, an array."""
        value = getattr(known, name)
        if isinstance(known, ModuleType) or not is_constant_structure(known):
            return self.of_known(value, name)
        label = f"{self._names.get(id(known), type(known).__name__.lower())}_{name}"
        if isinstance(value, float):
            return self._macro(label.upper(), value, comments_of_members(type(known)).get(name, ""))
        return self.of_known(value, label)

    def _array(self, value: Any, name: str) -> Value:
        item = INT if value.dtype.kind == "i" else REAL
        of = Array(item, value.shape, fixed=True)
        if 0 not in value.shape:
            self.arrays.setdefault(id(value), (name, value, of))
        domain = frozenset(int(number_) for number_ in value.flat) if item == INT else None
        return Value(self.arrays[id(value)][0] if 0 not in value.shape else "", of, ATOM, domain=domain)

    def whole(self, value: Value) -> Value:
        """The C of something that is known, as a structure or a number."""
        if value.type is not None or not value.is_known:
            return value
        if is_constant_structure(value.known):
            kind = type(value.known)
            return self.filled(self.structure(kind), [self.member_of(value.known, name) for name in kind._fields])
        if isinstance(value.known, tuple):
            return self.tuple_of([self.of_known(part, "") for part in value.known])
        raise NotPrintableError(f"{value.known!r} has no C")

    def filled(self, of: Struct, parts: list[Value]) -> Value:
        """A structure of these members."""
        codes = [self.convert(part, member).code for part, (_, member) in zip(parts, of.members, strict=True)]
        return Value(f"(struct {of.name}){{{', '.join(codes)}}}", of)

    def tuple_of(self, parts: list[Value]) -> Value:
        """A tuple: a row of reals, or a structure."""
        parts = [self.whole(part) for part in parts]
        types = [part.type for part in parts]
        if all(of in (REAL, CLOCK) for of in types):
            row = self._row(len(parts))
            codes = [self.convert(part, REAL).code for part in parts]
            return Value(f"(struct {row.name}){{{{{', '.join(codes)}}}}}", row)
        label = "_".join(_label(of) for of in types)
        members = tuple((f"part_{i}", of) for i, of in enumerate(types) if of is not None)
        found = Struct(f"rw_parts_{label}", members)
        self.structs.setdefault(found.name, (found, {}))
        return self.filled(found, parts)

    def made(self, kind: type[Any], given: list[Value], named: dict[str, Value]) -> Value:
        """A named tuple that is made in place."""
        of = self.structure(kind)
        values = dict(zip(kind._fields, given, strict=False)) | named
        defaults = kind._field_defaults
        return self.filled(of, [values.get(n) or self.of_known(defaults[n], n) for n in kind._fields])

    def builtin(self, name: str, parts: list[Value], of: Type) -> Value:
        """A small function of C that Python has built in."""
        assert isinstance(of, Scalar)
        first = parts[0].type
        assert isinstance(first, Scalar)
        label = name if REAL in (of, first) else f"{name}_{first.name if name == 'rw_to_int' else of.name}"
        if not self.single and label.endswith("_clock"):
            label = name
        template = _BUILTINS.get(label, _BUILTINS[name])
        self.builtins[label] = template.format(t=of.c, of=first.c, name=label, f="f" if self.single else "")
        return Value(f"{label}({', '.join(part.code for part in parts)})", of)


def _holds_arrays(example: Any) -> bool:
    return any(
        isinstance(part, np.ndarray) or (is_constant_structure(part) and _holds_arrays(part)) for part in example
    )


def _label(of: Type | None) -> str:
    if isinstance(of, Scalar):
        return of.name
    if isinstance(of, (Struct, Row)):
        return of.name.removeprefix("rw_")
    raise NotPrintableError("a tuple of arrays has no C")
