"""Expressions of Python as C99, in the same order of operations; what is known is reckoned here, once."""

from __future__ import annotations

import ast
import builtins
import functools
import inspect
import operator
import re
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from rw_ekf.c_code.c_types import (
    ATOM,
    BOOL,
    CHOICE,
    INT,
    LOGIC,
    PRODUCT,
    REAL,
    RELATION,
    SUM,
    UNARY,
    Array,
    Bound,
    NotPrintableError,
    Row,
    Scalar,
    Struct,
    Type,
    Value,
    View,
    wider,
)

if TYPE_CHECKING:
    from rw_ekf.c_code.c_program import Program

_BINARY: dict[type[ast.operator], tuple[str, int, Callable[[Any, Any], Any]]] = {
    ast.Add: ("+", SUM, operator.add),
    ast.Sub: ("-", SUM, operator.sub),
    ast.Mult: ("*", PRODUCT, operator.mul),
    ast.Div: ("/", PRODUCT, operator.truediv),
}
_CALLED: dict[type[ast.operator], tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Mod: ("rw_mod", operator.mod),
    ast.FloorDiv: ("rw_floor_div", operator.floordiv),
    ast.Pow: ("pow", operator.pow),
}
_COMPARED: dict[type[ast.cmpop], tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Lt: ("<", operator.lt),
    ast.LtE: ("<=", operator.le),
    ast.Gt: (">", operator.gt),
    ast.GtE: (">=", operator.ge),
    ast.Eq: ("==", operator.eq),
    ast.NotEq: ("!=", operator.ne),
}
_MATHS = frozenset(
    re.findall(
        r"\w+",
        "exp exp2 expm1 log log1p log2 log10 sqrt cbrt pow sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh "
        "atanh erf erfc floor ceil trunc fabs fmod copysign hypot",
    )
)
_WANTED = frozenset({"isnan", "isinf", "isfinite"})
_RESERVED = _MATHS | frozenset(
    re.findall(
        r"\w+",
        "auto break case char const continue default do double else enum extern float for goto if inline int long "
        "register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while "
        "bool true false j0 j1 jn y0 y1 yn gamma round",
    )
)


def c_name(name: str) -> str:
    """A local name that C does not take for something else."""
    return f"{name}_" if name in _RESERVED else name


def member_code(base: Value, name: str) -> str:
    """A member of a structure, or of one that a pointer leads to."""
    name = c_name(name)
    if base.code.startswith("&"):
        return f"{base.code[1:]}.{name}"
    return f"{base.within(UNARY)}{'->' if base.by_address else '.'}{name}"


def _reckoned(reckon: Callable[[Any, Any], Any], left: Value, right: Value) -> float | None:
    """An operation on what is known; None where something is not, or where Python has no number for it."""
    if not (left.is_known and right.is_known):
        return None
    try:
        found = reckon(left.known, right.known)
    except ArithmeticError:
        return None
    return found if isinstance(found, int | float) else None


class Scope:
    """The names of one function that is being printed, and its expressions."""

    def __init__(self, program: Program, function: Callable[..., Any], names: dict[str, Value]) -> None:
        self.program = program
        self.function = function
        self.names = names  # of parameters and variables
        self.constants: dict[str, Value] = {}  # variables that are given one value, which is known
        self.most: dict[str, int] = {}  # largest value of each counter of a loop
        self.used: set[str] = set()

    def fail(self, node: ast.AST, why: str) -> NotPrintableError:
        """The error that names the place."""
        return NotPrintableError(f"{self.function.__module__}.{self.function.__qualname__}: {why}: {ast.unparse(node)}")

    def value(self, node: ast.expr) -> Value:
        """An expression."""
        method = getattr(self, f"_{type(node).__name__.lower()}", None)
        if method is None:
            raise self.fail(node, "has no C")
        used = set(self.used)
        found: Value = method(node)
        if found.is_known:
            self.used = used  # C knows it without the variables that it came from
        return found

    def _constant(self, node: ast.Constant) -> Value:
        if isinstance(node.value, (bool, int, float)):
            of = BOOL if isinstance(node.value, bool) else INT if isinstance(node.value, int) else REAL
            return self.program.number(node.value, of)
        return Value("", None, ATOM, node.value)

    def _name(self, node: ast.Name) -> Value:
        name = node.id
        if name in self.constants:
            return self.constants[name]
        if name in self.names:
            self.used.add(name)
            return self.names[name]
        if name in self.function.__globals__:
            return self.program.of_global(self.function, name)
        return Value("", None, ATOM, getattr(builtins, name))

    def _attribute(self, node: ast.Attribute) -> Value:
        base = self.value(node.value)
        if isinstance(base.type, Array) and node.attr in ("shape", "size"):
            return Value("", None, ATOM, base.type.shape) if node.attr == "shape" else self._int(base.type.shape[0])
        if isinstance(base.type, View) and node.attr in ("shape", "size"):
            sizes = [Value(f"(int){base.code}.n{axis}", INT, UNARY) for axis in range(base.type.axes)]
            return sizes[0] if node.attr == "size" else self.program.tuple_of(sizes)
        if isinstance(base.type, Struct) and base.code:
            of = base.type.member(node.attr)
            code = member_code(base, node.attr)
            if isinstance(of, Struct) and of.held:
                return Value(f"&{code}", of, UNARY, by_address=True)
            return Value(code, of, domain=self.program.domains.get(node.attr))
        if base.is_known:
            return self.program.member_of(base.known, node.attr)
        raise self.fail(node, "has no such member")

    def _int(self, value: int) -> Value:
        return self.program.number(value, INT)

    def _subscript(self, node: ast.Subscript) -> Value:
        base = self.value(node.value)
        indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if base.is_known and base.type is None:
            index = self.value(indices[0])
            if not index.is_known:
                raise self.fail(node, "asks a constant for an element that is not known")
            return self.program.of_known(base.known[index.known], "")
        if isinstance(base.type, View):
            return self._of_view(node, base, base.type, indices)
        for index_node in indices:
            index = self.value(index_node)
            if isinstance(base.type, Array):
                of, domain = base.type.row, base.domain
                base = Value(f"{base.within(UNARY)}[{self.program.convert(index, INT).code}]", of, ATOM, domain=domain)
            elif isinstance(base.type, Row):
                base = Value(f"{base.within(UNARY)}.v[{self.program.convert(index, INT).code}]", REAL)
            elif isinstance(base.type, Struct) and index.is_known:
                name, of = base.type.members[index.known]
                base = Value(member_code(base, name), of)
            else:
                raise self.fail(node, "cannot be indexed")
        return base

    def _of_view(self, node: ast.Subscript, base: Value, of: View, indices: list[ast.expr]) -> Value:
        """An element, a row, or a stretch of a row."""
        if isinstance(node.slice, ast.Slice):
            if node.slice.lower is None or node.slice.upper is None or of.axes != 1:
                raise self.fail(node, "is no stretch from here to there")
            low, high = self.value(node.slice.lower), self.value(node.slice.upper)
            code = f"{base.code}.at + {low.within(SUM)}, {high.within(SUM)} - {low.within(SUM)}"
            return Value(f"(struct {of.name}){{{code}}}", of)
        codes = [self.program.convert(self.value(index), INT).within(UNARY) for index in indices]
        if len(codes) == of.axes:
            return Value(of.element(base.code, codes), of.item)
        code, row = of.part(base.code, codes)
        return Value(code, self.program.viewed(row))

    def _binop(self, node: ast.BinOp) -> Value:
        if type(node.op) in _CALLED:
            return self._by_function(node, *_CALLED[type(node.op)])
        if type(node.op) not in _BINARY:
            raise self.fail(node, "is an operation that is not printed")
        sign, binds, reckon = _BINARY[type(node.op)]
        left, right = self.value(node.left), self.value(node.right)
        known = _reckoned(reckon, left, right)
        of = wider(left.type, right.type)
        if isinstance(node.op, ast.Div):
            of = wider(of, REAL)
        elif of == BOOL:
            of = INT
        if known is not None and of == INT:
            return self._int(int(known))
        left, right = self.program.convert(left, of), self.program.convert(right, of)
        code = f"{left.within(binds - 1)} {sign} {right.within(binds)}"
        return Value(code, of, binds) if known is None else Value(code, of, binds, known)

    def _by_function(self, node: ast.BinOp, name: str, reckon: Callable[[Any, Any], Any]) -> Value:
        """An operation that C has no sign for, or another meaning of it."""
        left, right = self.value(node.left), self.value(node.right)
        of = REAL if name == "pow" else wider(left.type, right.type)
        known = _reckoned(reckon, left, right)
        if known is not None:
            assert isinstance(of, Scalar)
            return self.program.number(known, of)
        parts = [self.program.convert(part, of) for part in (left, right)]
        if name == "pow":
            return Value(f"pow{'f' if self.program.single else ''}({parts[0].code}, {parts[1].code})", REAL)
        return self.program.builtin(name, parts, of)

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        value = self.value(node.operand)
        if isinstance(node.op, ast.Not):
            if value.is_known:
                return self.program.number(not value.known, BOOL)
            return Value(f"!{value.within(UNARY - 1)}", BOOL, UNARY)
        if not isinstance(node.op, ast.USub):
            raise self.fail(node, "is an operation that is not printed")
        if value.is_known and isinstance(value.type, Scalar) and value.binds == ATOM and not value.code.isupper():
            return self.program.number(-value.known, value.type)
        code = f"-{value.within(UNARY)}"
        return (
            replace(value, code=code, binds=UNARY, known=-value.known)
            if value.is_known
            else Value(code, value.type, UNARY)
        )

    def _compare(self, node: ast.Compare) -> Value:
        parts = [node.left, *node.comparators]
        found = [self._related(a, op, b) for a, op, b in zip(parts[:-1], node.ops, parts[1:], strict=True)]
        return self._joined(found, "&&", False)

    def _related(self, one: ast.expr, op: ast.cmpop, other: ast.expr) -> Value:
        left, right = self.value(one), self.value(other)
        if isinstance(op, (ast.Is, ast.IsNot)):
            same = left.is_known and left.known is None
            return self.program.number(same == isinstance(op, ast.Is), BOOL)
        if isinstance(op, ast.In):
            choices = other.elts if isinstance(other, ast.Tuple) else []
            return self._joined([self._related(one, ast.Eq(), choice) for choice in choices], "||", True)
        sign, reckon = _COMPARED[type(op)]
        if left.possible is not None and right.possible is not None:
            reported = {bool(reckon(a, b)) for a in left.possible for b in right.possible}
            if len(reported) == 1:
                return self.program.number(reported.pop(), BOOL)
        elif left.is_known and right.is_known:
            return self.program.number(bool(reckon(left.known, right.known)), BOOL)
        of = wider(left.type, right.type)
        left, right = self.program.convert(left, of), self.program.convert(right, of)
        return Value(f"{left.within(RELATION)} {sign} {right.within(RELATION)}", BOOL, RELATION)

    def _boolop(self, node: ast.BoolOp) -> Value:
        is_or = isinstance(node.op, ast.Or)
        found: list[Value] = []
        for part in node.values:
            value = self.value(part)
            found.append(value)
            if value.is_known and bool(value.known) == is_or:
                break  # what follows is never evaluated
        return self._joined(found, "||" if is_or else "&&", is_or)

    def _joined(self, parts: list[Value], sign: str, ends: bool) -> Value:
        """Conditions of which the first that is `ends` decides."""
        if any(part.is_known and bool(part.known) == ends for part in parts):
            return self.program.number(ends, BOOL)
        parts = [part for part in parts if not part.is_known]
        if not parts:
            return self.program.number(not ends, BOOL)
        if len(parts) == 1:
            return parts[0]
        return Value(f" {sign} ".join(part.within(UNARY - 1) for part in parts), BOOL, LOGIC)

    def _ifexp(self, node: ast.IfExp) -> Value:
        test = self.value(node.test)
        if test.is_known:
            return self.value(node.body if test.known else node.orelse)
        one, other = self.value(node.body), self.value(node.orelse)
        of = wider(one.type, other.type)
        one, other = self.program.convert(one, of), self.program.convert(other, of)
        domain = one.possible | other.possible if one.possible and other.possible else None
        code = f"{test.within(CHOICE)} ? {one.within(CHOICE)} : {other.within(CHOICE)}"
        return Value(code, of, CHOICE, domain=domain, by_address=one.by_address)

    def _tuple(self, node: ast.Tuple) -> Value:
        return self.program.tuple_of([self.value(part) for part in node.elts])

    def _call(self, node: ast.Call) -> Value:
        if isinstance(node.func, ast.Attribute):
            if node.func.attr == "tolist":
                return self.value(node.func.value)  # nothing that is printed writes into the list
            if node.func.attr == "_replace":
                return self._replaced(node, node.func.value)
            if isinstance(node.func.value, ast.Name) and node.func.value.id == "math":
                return self._of_math(node.func.attr, [self.value(part) for part in node.args])
        callee = self.value(node.func).known
        if callee in (abs, min, max, float, bool, int):
            return self._builtin(callee.__name__, [self.value(part) for part in node.args])
        given: list[Value] = []
        for part in node.args:
            if isinstance(part, ast.Starred):
                whole = self.value(part.value)
                if whole.is_known and isinstance(whole.known, tuple):
                    given += [self.program.of_known(value, "") for value in whole.known]
                    continue
                assert isinstance(whole.type, Struct)
                domains = self.program.domains
                given += [Value(member_code(whole, n), of, domain=domains.get(n)) for n, of in whole.type.members]
            else:
                given.append(self.value(part))
        named = {item.arg: self.value(item.value) for item in node.keywords if item.arg is not None}
        if callee is functools.partial:
            return Value("", None, ATOM, Bound(given[0].known, tuple(given[1:])))
        if isinstance(callee, Bound):
            self.used |= {value.code for value in callee.given}
            callee, given = callee.function, [*callee.given, *given]
        if inspect.isclass(callee):
            return self.program.made(callee, given, named)
        return self.program.called(callee, given, named)

    def _replaced(self, node: ast.Call, of: ast.expr) -> Value:
        base = self.value(of)
        if not isinstance(base.type, Struct):
            raise self.fail(node, "replaces members of what is no named tuple")
        new = {item.arg: self.value(item.value) for item in node.keywords if item.arg is not None}
        parts = [new.get(name, Value(member_code(base, name), member)) for name, member in base.type.members]
        return self.program.filled(base.type, parts)

    def _of_math(self, name: str, parts: list[Value]) -> Value:
        if name in _WANTED:
            return Value(f"{name}({parts[0].code})", BOOL)
        if name not in _MATHS:
            raise NotPrintableError(f"math.{name} is not printed")
        of = REAL
        for part in parts:
            of = wider(of, part.type)  # type: ignore[assignment]
        single = self.program.single and of == REAL
        code = ", ".join(self.program.convert(part, of).code for part in parts)
        return Value(f"{name}{'f' if single else ''}({code})", of)

    def _builtin(self, name: str, parts: list[Value]) -> Value:
        first = parts[0]
        if name == "bool":
            return first
        if name == "float":
            return self.program.convert(first, REAL)
        if name == "int":
            return first if first.type == INT else self.program.builtin("rw_to_int", [first], INT)
        if name == "abs":
            if first.type == INT:
                raise NotPrintableError("abs of a whole number is not printed")
            return Value(f"fabs{'f' if self.program.single and first.type == REAL else ''}({first.code})", first.type)
        if all(part.is_known for part in parts):
            known = getattr(builtins, name)(part.known for part in parts)
            return self.program.number(known, parts[0].type or REAL)  # type: ignore[arg-type]
        of: Type | None = None
        for part in parts:
            of = wider(of, part.type)
        found = self.program.convert(first, of or REAL)
        for part in parts[1:]:
            found = self.program.builtin(f"rw_{name}", [found, self.program.convert(part, of or REAL)], of or REAL)
        return found
