"""Scalar functions of Python as functions of MATLAB: tuples are rows, and whatever is called comes along.

For the equations of `rw_ekf.model` and of effects alone, which import only `math`: anything else is refused by name.
What MATLAB has no word for (a choice within an expression, an element of a result) is in `SMALL_FUNCTIONS`.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import re
from collections.abc import Callable, Mapping
from typing import Any

from rw_ekf.c_code.c_types import NotPrintableError
from rw_ekf.c_code.python_source import source_of
from rw_ekf.model.friction import FrictionCurve
from rw_ekf.model.law import Place
from rw_ekf.model.moment import Moment

SMALL_FUNCTIONS = """function value = at_(row, place)
value = row(place);
end

function value = choice_(test, one, other)
if test
    value = one;
else
    value = other;
end
end

function value = copysign_(size, sign_of)
value = abs(size);
if sign_of < 0
    value = -value;
end
end
"""
_BINARY = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_COMPARED = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "~="}
_SAME = frozenset(
    re.findall(
        r"\w+",
        "exp expm1 log log1p sqrt sin cos tan asin acos atan atan2 sinh cosh tanh floor hypot isnan isinf isfinite",
    )
)
_RESERVED = frozenset(
    re.findall(r"\w+", "end for while if else elseif function return break continue global persistent")
)
_PLACES = {
    name: str(place) for kind in (FrictionCurve, Place, Moment) for place, name in enumerate(kind._fields, start=1)
} | {"columns": "7:9"}
_INDENT = "    "


class Functions:
    """The functions that are printed so far, by their names."""

    def __init__(self, instead: Mapping[Callable[..., Any], Callable[..., Any]] | None = None) -> None:
        """instead: what is printed in place of a function."""
        self.texts: dict[str, str] = {}
        self._instead = {} if instead is None else instead

    def name_of(self, function: Callable[..., Any]) -> str:
        """Its name in MATLAB; it is printed, with those that it calls, where it is not yet."""
        function = self._instead.get(function, function)
        module = function.__module__.rpartition(".")[2]
        name = f"{module}_{function.__name__.lstrip('_')}"
        if name not in self.texts:
            self.texts[name] = ""  # requested from here on
            self.texts[name] = _Printer(self, function).text(name)
        return name

    @property
    def text(self) -> str:
        """All of them."""
        return "\n".join(self.texts.values())


class _Printer:
    """One function."""

    def __init__(self, functions: Functions, function: Callable[..., Any]) -> None:
        self.functions, self.function = functions, function
        self.source = source_of(function)
        self.local = {node.id for node in ast.walk(self.source.tree) if isinstance(node, ast.Name) and _stored(node)}
        self.local |= set(inspect.signature(function).parameters)
        self.lines: list[str] = []

    def text(self, name: str) -> str:
        """Its definition."""
        given = ", ".join(_name(parameter) for parameter in inspect.signature(self.function).parameters)
        body = self.source.tree.body
        if isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
            body = body[1:]
        self._block(body, "")
        stated = self.source.docstring.split("\n")[0]
        return "\n".join([f"function result = {name}({given})", f"% {stated}", *self.lines, "end", ""])

    def _fail(self, node: ast.AST) -> NotPrintableError:
        where = f"{self.function.__module__}.{self.function.__qualname__}"
        return NotPrintableError(f"{where}: has no MATLAB: {ast.unparse(node)}")

    # Statements.

    def _block(self, nodes: list[ast.stmt], indent: str) -> None:
        for node in nodes:
            self._statement(node, indent)

    def _statement(self, node: ast.stmt, indent: str) -> None:
        inner = indent + _INDENT
        if isinstance(node, ast.Return) and node.value is not None:
            self.lines += [f"{indent}result = {self.value(node.value)};", f"{indent}return"]
        elif isinstance(node, ast.Assign):
            for target in reversed(node.targets):
                self._assign(target, node.value, indent)
        elif isinstance(node, ast.AugAssign):
            self._assign(node.target, ast.BinOp(node.target, node.op, node.value), indent)
        elif isinstance(node, ast.If):
            self.lines.append(f"{indent}if {self.value(node.test)}")
            self._block(node.body, inner)
            if node.orelse:
                self.lines.append(f"{indent}else")
                self._block(node.orelse, inner)
            self.lines.append(f"{indent}end")
        elif isinstance(node, ast.For):
            self._for(node, indent)
        elif isinstance(node, ast.While):
            self.lines.append(f"{indent}while {self.value(node.test)}")
            self._block(node.body, inner)
            self.lines.append(f"{indent}end")
        elif isinstance(node, (ast.Break, ast.Continue)):
            self.lines.append(f"{indent}{'break' if isinstance(node, ast.Break) else 'continue'}")
        else:
            raise self._fail(node)

    def _for(self, node: ast.For, indent: str) -> None:
        if not (isinstance(node.iter, ast.Call) and ast.unparse(node.iter.func) == "range" and len(node.iter.args) < 3):
            raise self._fail(node.iter)
        bounds = [self.value(part) for part in node.iter.args]
        begin, stop = ("0", bounds[0]) if len(bounds) == 1 else (bounds[0], bounds[1])
        self.lines.append(f"{indent}for {self.value(node.target)} = {begin}:({stop} - 1)")
        self._block(node.body, indent + _INDENT)
        self.lines.append(f"{indent}end")

    def _assign(self, target: ast.expr, value: ast.expr, indent: str) -> None:
        if isinstance(target, ast.Name):
            self.lines.append(f"{indent}{_name(target.id)} = {self.value(value)};")
            return
        if not isinstance(target, ast.Tuple):
            raise self._fail(target)  # arrays are handed over by value in MATLAB
        self.lines.append(f"{indent}found_ = {self.value(value)};")
        for place, part in enumerate(target.elts, start=1):
            if not isinstance(part, ast.Name):
                raise self._fail(part)
            if part.id != "_":
                self.lines.append(f"{indent}{_name(part.id)} = found_({place});")

    # Expressions.

    def value(self, node: ast.expr) -> str:
        """An expression; everything that binds less than a call is in brackets."""
        method = getattr(self, f"_{type(node).__name__.lower()}", None)
        if method is None:
            raise self._fail(node)
        found: str = method(node)
        return found

    def _constant(self, node: ast.Constant) -> str:
        return number(node.value)

    def _name(self, node: ast.Name) -> str:
        if node.id in self.local:
            return _name(node.id)
        value = self.function.__globals__.get(node.id)
        if not isinstance(value, (bool, int, float)):
            raise self._fail(node)
        return number(value)

    def _attribute(self, node: ast.Attribute) -> str:
        if isinstance(node.value, ast.Name) and node.value.id == "math":
            return number(getattr(math, node.attr))
        if node.attr in _PLACES:
            return f"{self.value(node.value)}({_PLACES[node.attr]})"
        raise self._fail(node)

    def _subscript(self, node: ast.Subscript) -> str:
        if isinstance(node.slice, ast.Slice):
            raise self._fail(node)
        place = f"{self.value(node.slice)} + 1"
        if isinstance(node.value, ast.Name):
            return f"{self.value(node.value)}({place})"
        return f"at_({self.value(node.value)}, {place})"

    def _binop(self, node: ast.BinOp) -> str:
        if type(node.op) not in _BINARY:
            raise self._fail(node)
        return f"({self.value(node.left)} {_BINARY[type(node.op)]} {self.value(node.right)})"

    def _unaryop(self, node: ast.UnaryOp) -> str:
        sign = {ast.USub: "-", ast.Not: "~", ast.UAdd: "+"}.get(type(node.op))
        if sign is None:
            raise self._fail(node)
        return f"({sign}{self.value(node.operand)})"

    def _compare(self, node: ast.Compare) -> str:
        if isinstance(node.ops[0], ast.In) and isinstance(node.comparators[0], ast.Tuple):
            return f"any({self.value(node.left)} == {self.value(node.comparators[0])})"
        sides = [self.value(side) for side in (node.left, *node.comparators)]
        if any(type(op) not in _COMPARED for op in node.ops):
            raise self._fail(node)
        pairs = zip(sides, node.ops, sides[1:], strict=False)
        return f"({' && '.join(f'{one} {_COMPARED[type(op)]} {other}' for one, op, other in pairs)})"

    def _boolop(self, node: ast.BoolOp) -> str:
        sign = " || " if isinstance(node.op, ast.Or) else " && "
        return f"({sign.join(self.value(part) for part in node.values)})"

    def _ifexp(self, node: ast.IfExp) -> str:
        return f"choice_({self.value(node.test)}, {self.value(node.body)}, {self.value(node.orelse)})"

    def _tuple(self, node: ast.Tuple) -> str:
        return f"[{', '.join(self.value(part) for part in node.elts)}]"

    def _call(self, node: ast.Call) -> str:
        if node.keywords:
            raise self._fail(node)
        given = [self.value(part) for part in node.args]
        if isinstance(node.func, ast.Attribute) and ast.unparse(node.func.value) == "math":
            return self._of_math(node, given)
        if not isinstance(node.func, ast.Name):
            raise self._fail(node)
        callee = self.function.__globals__.get(node.func.id, getattr(builtins, node.func.id, None))
        if callee in (abs, min, max):
            found = given[0]
            for other in given[1:]:
                found = f"{node.func.id}({found}, {other})"
            return found if len(given) > 1 else f"{node.func.id}({found})"
        if callee in (float, bool, int):
            return f"fix({given[0]})" if callee is int else given[0]
        if inspect.isclass(callee) and hasattr(callee, "_fields"):
            return f"[{', '.join(given)}]"
        if not inspect.isfunction(callee):
            raise self._fail(node)
        rest = list(inspect.signature(callee).parameters.values())[len(given) :]
        return f"{self.functions.name_of(callee)}({', '.join([*given, *(number(p.default) for p in rest)])})"

    def _of_math(self, node: ast.Call, given: list[str]) -> str:
        assert isinstance(node.func, ast.Attribute)
        if node.func.attr == "copysign":
            return f"copysign_({', '.join(given)})"
        if node.func.attr not in _SAME:
            raise self._fail(node)
        return f"{node.func.attr}({', '.join(given)})"


def number(value: Any) -> str:
    """A number as MATLAB has it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if not isinstance(value, (int, float)):
        raise NotPrintableError(f"{value!r} has no MATLAB")
    if math.isnan(value):
        return "NaN"
    if math.isinf(value):
        return "Inf" if value > 0 else "(-Inf)"
    return repr(value) if value >= 0 else f"({value!r})"


def _stored(node: ast.Name) -> bool:
    return isinstance(node.ctx, ast.Store)


def _name(name: str) -> str:
    """A name that MATLAB takes."""
    if name == "_":
        return "unused_"
    return f"{name}_" if name in _RESERVED or name in _SAME else name
