"""Variables of one Python function as C99: what is given a value, of which type, and what needs no variable at all."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rw_ekf.c_code.c_expressions import Scope, c_name, member_code
from rw_ekf.c_code.c_types import (
    BOOL,
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
    c_type,
    declared,
    wider,
)
from rw_ekf.c_code.python_source import Source

if TYPE_CHECKING:
    from rw_ekf.c_code.c_program import Program


def assigned_names(tree: ast.AST) -> Counter[str]:
    """How often each local name is given a value."""
    found: Counter[str] = Counter()
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found[node.id] += 1
        if isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            found[node.target.id] += 1
    return found


class Stores:
    """Assignments in one pass over a function; what it finds out about types and use goes into the next pass."""

    def __init__(
        self, program: Program, function: Callable[..., object], source: Source, parameters: dict[str, Value],
        before: Stores | None,
    ) -> None:  # fmt: skip
        self.program = program
        self.source = source
        types = {} if before is None else before.types
        self.types: dict[str, Type] = dict(types)
        self.wanted = None if before is None else before.scope.used
        self.stores: Counter[str] = Counter()  # how often each name is given a value, of what is reached
        self.scope: Scope = Scope(program, function, dict(parameters))
        for name, of in types.items():
            if name not in parameters:
                self.scope.names[name] = _variable(name, of)
        self.result: Type | None = None
        self.lines: list[str] = []
        self.indent = 1
        self._times = assigned_names(source.tree) if before is None else before.stores
        self._same = set() if before is None else before.same  # names that are only ever given one known value
        self.given: dict[str, list[Any]] = {}
        self._parameters = parameters
        self._temporaries = 0
        self._whiles = 0
        self._reported = 0  # line up to which comments are carried over
        self.ends = False

    @property
    def same(self) -> set[str]:
        """Names that are only ever given one value, which is known."""
        return {name for name, values in self.given.items() if len(set(values)) == 1 and values[0] is not None}

    def is_settled(self, before: Stores | None) -> bool:
        """Whether another pass would find the same."""
        if before is None:
            return False
        mine, other = (self.types, self.scope.used, self.stores), (before.types, before.scope.used, before.stores)
        return mine == other and self.same == before.same

    def declarations(self) -> list[str]:
        """Of the local variables."""
        return [
            f"    {declared(of, c_name(name))};"
            for name, of in self.types.items()
            if name not in self._parameters and (self.wanted is None or name in self.wanted)
        ]

    def _line(self, text: str) -> None:
        self.lines.append("    " * self.indent + text)

    def _assign(self, targets: list[ast.expr], node: ast.expr) -> None:
        if len(targets) == 1 and isinstance(targets[0], ast.Tuple):
            self._unpack(targets[0].elts, node)
            return
        if all(isinstance(t, ast.Name) and not self._is_wanted(t.id) for t in targets):
            used = set(self.scope.used)
            value = self.scope.value(node) if self._may_be_known(targets) else None
            self.scope.used = used
            if value is None or not (_is_constant(value)):
                self.stores.update(t.id for t in targets if isinstance(t, ast.Name))
                return
        self._store_all(targets, self.scope.value(node))

    def _may_be_known(self, targets: list[ast.expr]) -> bool:
        return all(isinstance(t, ast.Name) and (self._times[t.id] == 1 or t.id in self._same) for t in targets)

    def _store_all(self, targets: list[ast.expr], value: Value) -> None:
        for target in reversed(targets):
            self._store(target, value)
            if len(targets) > 1 and not value.is_known:
                value = self.scope.value(_loaded(target))

    def _is_wanted(self, name: str) -> bool:
        return name != "_" and (self.wanted is None or name in self.wanted or name in self._parameters)

    def _store(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self._store_name(target.id, value)
        elif (
            isinstance(target, ast.Subscript)
            and isinstance(target.slice, ast.Tuple)
            and any(isinstance(part, ast.Slice) for part in target.slice.elts)
        ):
            self._store_line(target, target.slice.elts, value)
        else:
            place = self.scope.value(_loaded(target))
            if not isinstance(place.type, Scalar):
                raise self.scope.fail(target, "is no single element")
            self._line(f"{place.code} = {self.program.convert(value, place.type).code};")

    def _store_line(self, target: ast.Subscript, parts: list[ast.expr], value: Value) -> None:
        """A number into a whole row or column."""
        base = self.scope.value(target.value)
        if isinstance(base.type, View):
            axis = [isinstance(part, ast.Slice) for part in parts].index(True)
            codes = ["at" if isinstance(part, ast.Slice) else self.scope.value(part).code for part in parts]
            self._line(f"for (int at = 0; at < {base.code}.n{axis}; ++at) {{")
            self._line(
                f"    {base.type.element(base.code, codes)} = {self.program.convert(value, base.type.item).code};"
            )
            self._line("}")
            return
        assert isinstance(base.type, Array)
        indices = ["at" if isinstance(part, ast.Slice) else self.scope.value(part).code for part in parts]
        count = base.type.shape[[isinstance(part, ast.Slice) for part in parts].index(True)]
        self._line(f"for (int at = 0; at < {count}; ++at) {{")
        place = f"{base.within(UNARY)}{''.join(f'[{index}]' for index in indices)}"
        self._line(f"    {place} = {self.program.convert(value, base.type.item).code};")
        self._line("}")
        self.program.cost += count

    def _store_name(self, name: str, value: Value) -> None:
        self.stores[name] += 1
        known = value.known if value.is_known and value.type in (INT, BOOL) else None
        self.given.setdefault(name, []).append(known)
        once = self._times[name] == 1 or name in self._same
        if once and name not in self._parameters and _is_constant(value):
            self.scope.constants[name] = value
            return
        if not self._is_wanted(name):
            return
        value = self.program.whole(value)
        assert value.type is not None
        of = value.type
        if name in self._parameters:
            of = self._parameters[name].type or of
        elif name in self.types:
            of = wider(self.types[name], of)
        if name not in self._parameters:
            self.types[name] = of
        known = self.scope.names.get(name)
        domain = None
        if of == INT and self._times[name] == 1:
            domain = value.possible
        self.scope.names[name] = _variable(name, of, domain)
        if known is not None and known.code and name in self._parameters:
            self.scope.names[name] = Value(known.code, of, by_address=known.by_address)
        self._line(f"{c_name(name)} = {self.program.convert(value, of).code};")

    def _unpack(self, targets: list[ast.expr], node: ast.expr) -> None:
        if isinstance(node, ast.Tuple):
            self._at_once(targets, node.elts)
            return
        value = self.scope.value(node)
        if value.is_known and value.type is None:
            for target, part in zip(targets, value.known, strict=True):
                self._store(target, self.program.of_known(part, ""))
            return
        if isinstance(node, ast.Call):
            if not any(not isinstance(t, ast.Name) or self._is_wanted(t.id) for t in targets):
                self._line(f"(void){value.code};")
                return
            self._temporaries += 1
            name = f"found_{self._temporaries}"
            assert value.type is not None
            self._line(f"const {c_type(value.type)} {name} = {value.code};")
            value = Value(name, value.type)
        for i, target in enumerate(targets):
            self._store(target, self._part(value, i))

    def _part(self, value: Value, i: int) -> Value:
        """An element of a tuple."""
        if isinstance(value.type, Row):
            return Value(f"{value.code}.v[{i}]", REAL)
        if not isinstance(value.type, Struct):
            raise NotPrintableError(f"{value.code} is no tuple")
        name, of = value.type.members[i]
        code = member_code(value, name)
        if isinstance(of, Struct) and of.held:
            return Value(f"&{code}", of, UNARY, by_address=True)
        return Value(code, of, domain=self.program.domains.get(name))

    def _at_once(self, targets: list[ast.expr], nodes: list[ast.expr]) -> None:
        """Several at once: over temporaries where one is read after it is written."""
        for target in targets:
            if isinstance(target, ast.Name) and not self._is_wanted(target.id) and self._times[target.id] != 1:
                self.stores[target.id] += 1
        written = {ast.unparse(target) for target in targets}
        pairs = [
            (t, n) for t, n in zip(targets, nodes, strict=True) if not isinstance(t, ast.Name) or self._is_wanted(t.id)
            or self._times[t.id] == 1
        ]  # fmt: skip
        read = {
            ast.unparse(part) for _, n in pairs for part in ast.walk(n) if isinstance(part, (ast.Name, ast.Subscript))
        }
        if not written & read:
            for target, node in pairs:
                if isinstance(target, ast.Name) and not self._is_wanted(target.id):
                    value = self.scope.value(node)
                    if _is_constant(value):
                        self._store(target, value)
                    else:
                        self.stores[target.id] += 1
                    continue
                self._store(target, self.scope.value(node))
            return
        kept: list[tuple[ast.expr, Value]] = []
        for target, node in pairs:
            value = self.program.whole(self.scope.value(node))
            assert value.type is not None
            self._temporaries += 1
            name = f"next_{self._temporaries}"
            self._line(f"const {c_type(value.type)} {name} = {value.code};")
            kept.append((target, Value(name, value.type)))
        for target, value in kept:
            self._store(target, value)

    def _augmented(self, node: ast.AugAssign) -> None:
        if isinstance(node.target, ast.Name) and not self._is_wanted(node.target.id):
            self.stores[node.target.id] += 1
            return
        if isinstance(node.target, ast.Name):
            self.scope.most.pop(node.target.id, None)
        used = set(self.scope.used)
        value = self.scope.value(ast.BinOp(_loaded(node.target), node.op, node.value))
        if isinstance(node.target, ast.Name) and node.target.id not in used:
            self.scope.value(node.value)
            rest = {part.id for part in ast.walk(node.value) if isinstance(part, ast.Name)}
            if node.target.id not in rest:
                self.scope.used.discard(node.target.id)  # that it is added to itself is no use of it
        self._store(node.target, value)


def _loaded(target: ast.expr) -> ast.expr:
    """The same expression, to be read."""
    found = ast.parse(ast.unparse(target), mode="eval").body
    return ast.copy_location(found, target)


def _variable(name: str, of: Type, domain: frozenset[int] | None = None) -> Value:
    return Value(c_name(name), of, domain=domain, by_address=isinstance(of, Struct) and of.held)


def _is_constant(value: Value) -> bool:
    """Whether a variable of this one value needs no C."""
    return value.is_known and value.type in (None, INT, BOOL)
