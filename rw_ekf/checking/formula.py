"""A formula as a user writes it, read into a small tree: whitelisted arithmetic and functions, nothing is ever run.

Python's own parser finds the structure; whatever is not on the lists below is a fault with its place in the text. What
evaluates a tree, the filter's program and the simulated wheel each for itself, is elsewhere.
"""

from __future__ import annotations

import ast
import math
import re
import warnings
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

from rw_ekf.checking.wording import suggestion

# Of the wheel at a moment, with the units in which a formula has them.
QUANTITIES = {"omega": "rad/s", "current": "A", "temperature": "degC", "angle": "rad", "time": "s"}
ONE_ARGUMENT = (
    "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "expm1", "log", "log1p", "sqrt", "abs",
    "sgn",
)  # fmt: skip
TWO_ARGUMENTS = ("atan2", "min", "max")
FUNCTIONS = (*ONE_ARGUMENT, *TWO_ARGUMENTS)
RESERVED = frozenset({*QUANTITIES, *FUNCTIONS, "pi"})
LONGEST, DEEPEST = 400, 100  # characters; operations within each other

_BINARY: dict[type[ast.operator], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**",
}  # fmt: skip
_ADVICE: dict[type[ast.AST], str] = {
    ast.BitXor: "^ is no power here: write **",
    ast.Attribute: "a dot asks for a part of something: write functions by their names alone, as sin(omega)",
    ast.Compare: "a comparison is not a number: use min, max, abs or sgn",
    ast.IfExp: "conditions are not supported: use min, max, abs or sgn",
    ast.BoolOp: "conditions are not supported: use min, max, abs or sgn",
    ast.Lambda: "only arithmetic and functions by name are supported",
    ast.Subscript: "brackets [] are not supported: use ()",
    ast.Tuple: "a comma belongs between the arguments of a function only; write 1.5, not 1,5",
}


@dataclass(frozen=True)
class Node:
    """An operation or a function of its parts, a `number`, or a `name`; at: its place in the text, from 0."""

    op: str
    parts: tuple[Node, ...] = ()
    value: float = 0.0
    name: str = ""
    at: int = field(default=0, compare=False)

    def names(self) -> Iterator[str]:
        """Every name in it, as often as it stands there."""
        if self.op == "name":
            yield self.name
        for part in self.parts:
            yield from part.names()


class FormulaError(Exception):
    """A formula that is none: what was found, and where in its text, from 0."""

    def __init__(self, words: str, at: int = 0) -> None:
        super().__init__(words)
        self.words, self.at = words, at


def parsed(text: str, parameters: Collection[str]) -> Node:
    """The tree of a formula in the quantities and these parameters. Raises FormulaError."""
    if len(text) > LONGEST:
        raise FormulaError(f"has {len(text)} characters; {LONGEST} are the most")
    flat = re.sub(r"\s", " ", text)  # a formula may go over several lines
    lead = len(flat) - len(flat.lstrip())
    if not flat.strip():
        raise FormulaError("is empty: write a formula, such as a * omega**2")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = ast.parse(flat.strip(), mode="eval").body
    except SyntaxError as error:
        at = min(max((error.offset or 1) - 1, 0), len(flat.strip()))
        raise FormulaError(f"is not a formula: {error.msg}", lead + at) from None
    except (ValueError, RecursionError, MemoryError) as error:
        raise FormulaError(f"is not a formula: {error}", lead) from None
    return _Reader(flat.strip(), lead, frozenset(parameters)).node(found, 1)


class _Reader:
    """Turns Python's tree of one text into nodes, and refuses what is on no list."""

    def __init__(self, text: str, lead: int, parameters: frozenset[str]) -> None:
        self._bytes, self._lead, self._parameters = text.encode(), lead, parameters

    def _at(self, node: ast.expr) -> int:
        """Python counts bytes of UTF-8."""
        return self._lead + len(self._bytes[: node.col_offset].decode())

    def node(self, found: ast.expr, depth: int) -> Node:
        at = self._at(found)
        if depth > DEEPEST:
            raise FormulaError(f"is nested more than {DEEPEST} deep", at)
        if isinstance(found, ast.Constant):
            return Node("number", value=_number(found.value, at), at=at)
        if isinstance(found, ast.Name):
            return self._name(found.id, at)
        if isinstance(found, ast.UnaryOp) and isinstance(found.op, ast.USub | ast.UAdd):
            inner = self.node(found.operand, depth + 1)
            return Node("neg", (inner,), at=at) if isinstance(found.op, ast.USub) else inner
        if isinstance(found, ast.BinOp) and type(found.op) in _BINARY:
            parts = (self.node(found.left, depth + 1), self.node(found.right, depth + 1))
            return Node(_BINARY[type(found.op)], parts, at=at)
        if isinstance(found, ast.Call):
            return self._call(found, at, depth)
        kind: ast.AST = found.op if isinstance(found, ast.BinOp | ast.UnaryOp) else found
        advice = _ADVICE.get(type(kind), "only + - * / **, numbers, names and functions by name are supported")
        raise FormulaError(f"has something that is no arithmetic: {advice}", at)

    def _name(self, name: str, at: int) -> Node:
        if name == "pi":
            return Node("number", value=math.pi, at=at)
        if name in FUNCTIONS:
            raise FormulaError(f"has {name} without its argument: write {name}(...)", at)
        if name not in QUANTITIES and name not in self._parameters:
            known = suggestion(name, [*self._parameters, *QUANTITIES, "pi"])
            raise FormulaError(f"has the unknown name {name!r}; {known}", at)
        return Node("name", name=name, at=at)

    def _call(self, found: ast.Call, at: int, depth: int) -> Node:
        if isinstance(found.func, ast.Attribute):
            raise FormulaError(f"has something that is no arithmetic: {_ADVICE[ast.Attribute]}", at)
        if not isinstance(found.func, ast.Name) or found.func.id not in FUNCTIONS:
            if isinstance(found.func, ast.Name) and found.func.id not in {*QUANTITIES, *self._parameters}:
                name = found.func.id
                raise FormulaError(f"has the unknown function {name!r}; {suggestion(name, FUNCTIONS)}", at)
            raise FormulaError("calls something that is no function: write * between two factors", at)
        name, count = found.func.id, 2 if found.func.id in TWO_ARGUMENTS else 1
        if found.keywords or any(isinstance(part, ast.Starred) for part in found.args) or len(found.args) != count:
            words = "two arguments" if count == 2 else "one argument"
            raise FormulaError(f"gives {name} other than {words}", at)
        return Node(name, tuple(self.node(part, depth + 1) for part in found.args), at=at)


def _number(value: object, at: int) -> float:
    """A finite number that is neither true, text nor complex."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise FormulaError(f"has {value!r}, which is no number", at)
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise FormulaError("has a number that is too large", at)
    return number


def require_proportional(tree: Node, name: str) -> None:
    """Raise FormulaError, at the place that makes it otherwise, where a tree is not proportional to a parameter."""
    power = _power(tree, name)
    if power != 1:
        words = "does not depend on it" if power == 0 else "goes with another power of it"
        raise FormulaError(f"must be proportional to {name}, the parameter without a start; it {words}", tree.at)


def _power(node: Node, name: str) -> int:
    """With which power of a parameter a tree goes."""
    powers = [_power(part, name) for part in node.parts]
    if node.op == "name":
        return int(node.name == name)
    if node.op == "neg":
        return powers[0]
    if node.op in {"+", "-"}:
        if powers[0] != powers[1]:
            raise FormulaError(
                f"must be proportional to {name}, the parameter without a start; here something with it and something "
                "without it are added: multiply all of it by that parameter",
                node.at,
            )
        return powers[0]
    if node.op in {"*", "/"}:
        return powers[0] + powers[1] if node.op == "*" else powers[0] - powers[1]
    if any(powers):
        where = "a power" if node.op == "**" else f"{node.op}()"
        raise FormulaError(
            f"must be proportional to {name}, the parameter without a start; it stands in {where}", node.at
        )
    return 0
