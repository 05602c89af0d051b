"""Statements of one Python function as C99; branches that this model never takes are left out."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rw_ekf.flight.c_expressions import Scope, c_name, member_code
from rw_ekf.flight.c_types import (
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
    c_type,
    declared,
    wider,
)
from rw_ekf.flight.python_source import Source

if TYPE_CHECKING:
    from rw_ekf.flight.c_program import Program

_ENDS = (ast.Return, ast.Break, ast.Continue)


def assigned_names(tree: ast.FunctionDef) -> Counter[str]:
    """How often each local name is given a value."""
    found: Counter[str] = Counter()
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found[node.id] += 1
        if isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            found[node.target.id] += 1
    return found


class Body:
    """One pass over a function; what it finds out about types and use goes into the next pass."""

    def __init__(
        self, program: Program, function: Callable[..., object], source: Source, parameters: dict[str, Value],
        before: Body | None,
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
        self._told = 0  # line up to which comments are carried over
        self.ends = False

    def run(self) -> None:
        """Print the body."""
        body = self.source.tree.body
        if isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
            self._told = body[0].end_lineno or 0
            body = body[1:]
        else:
            self._told = self.source.tree.body[0].lineno - 1
        self.ends = self._block(body)

    @property
    def same(self) -> set[str]:
        """Names that are only ever given one value, which is known."""
        return {name for name, values in self.given.items() if len(set(values)) == 1 and values[0] is not None}

    def is_settled(self, before: Body | None) -> bool:
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

    def _comment(self, node: ast.stmt) -> None:
        last = node.lineno if hasattr(node, "body") else (node.end_lineno or node.lineno)
        for line in range(self._told + 1, last + 1):
            if line in self.source.comments:
                self._line(f"/* {self.source.comments[line].replace('*/', '* /')} */")
        self._told = max(self._told, last)

    def _block(self, nodes: list[ast.stmt]) -> bool:
        """Print statements; whether none that follows would be reached."""
        for node in nodes:
            if not isinstance(node, ast.If):
                self._comment(node)
            self.program.cost += 1
            if self._statement(node):
                return True
        return False

    def _statement(self, node: ast.stmt) -> bool:
        if isinstance(node, ast.If):
            return self._if(node)
        if isinstance(node, ast.For):
            self._for(node)
        elif isinstance(node, ast.While):
            self._while(node)
        elif isinstance(node, ast.Return):
            self._return(node)
        elif isinstance(node, ast.Assign):
            self._assign(node.targets, node.value)
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            self._assign([node.target], node.value)
        elif isinstance(node, ast.AugAssign):
            self._augmented(node)
        elif isinstance(node, ast.Expr):
            self._line(f"{self.scope.value(node.value).code};")
        elif isinstance(node, (ast.Break, ast.Continue)):
            self._line("break;" if isinstance(node, ast.Break) else "continue;")
        elif not isinstance(node, ast.Pass):
            raise self.scope.fail(node, "is a statement that is not printed")
        return isinstance(node, _ENDS)

    def _if(self, node: ast.If) -> bool:
        test = self.scope.value(node.test)
        if test.is_known:
            taken = node.body if test.known else node.orelse
            if test.known:
                self._comment(node)
            self._told = max(self._told, (taken[0].lineno - 1) if taken else (node.end_lineno or 0))
            ended = self._block(taken)
            self._told = max(self._told, node.end_lineno or 0)
            return ended
        self._comment(node)
        self._line(f"if ({test.code}) {{")
        before = self.program.cost
        ended = self._indented(node.body)
        cost, self.program.cost = self.program.cost, before
        ended_else = False
        if node.orelse:
            self._line("} else {")
            ended_else = self._indented(node.orelse)
        self._line("}")
        self.program.cost = max(cost, self.program.cost)
        if ended and not node.orelse:
            self._narrow(node.test)
        return ended and ended_else

    def _narrow(self, test: ast.expr) -> None:
        """After `if name == value: return` the name has another value."""
        if isinstance(test, ast.Compare) and isinstance(test.left, ast.Name) and isinstance(test.ops[0], ast.Eq):
            value = self.scope.names.get(test.left.id)
            other = self.scope.value(test.comparators[0])
            if value is not None and value.domain is not None and other.is_known:
                rest = value.domain - {other.known}
                self.scope.names[test.left.id] = Value(value.code, value.type, domain=rest)

    def _indented(self, nodes: list[ast.stmt]) -> bool:
        self.indent += 1
        names = dict(self.scope.names)
        ended = self._block(nodes)
        for name, value in names.items():
            self.scope.names[name] = value if value.domain is not None else self.scope.names[name]
        self.indent -= 1
        return ended

    def _repeated(self, nodes: list[ast.stmt], times: int) -> None:
        before, self.program.cost = self.program.cost, 0
        self._indented(nodes)
        self._line("}")
        self.program.cost = before + times * (self.program.cost + 1)

    def _for(self, node: ast.For) -> None:
        call, name = node.iter, node.target
        if not (isinstance(call, ast.Call) and isinstance(name, ast.Name) and ast.unparse(call.func) == "range"):
            raise self.scope.fail(node.iter, "is no range to loop over")
        parts = [self.scope.value(part) for part in call.args]
        start, stop = (self.program.number(0, INT), parts[0]) if len(parts) == 1 else (parts[0], parts[1])
        step = parts[2].known if len(parts) == 3 else 1
        if start.is_known and stop.is_known and len(range(start.known, stop.known, step)) == 0:
            self._told = max(self._told, node.end_lineno or 0)
            return
        counter = c_name(name.id) if name.id != "_" else "turn"
        guard = ""
        if step < 0:
            most = self._most(call.args[0])
            times = None if most is None else most + 1
        else:
            limit = self._most(call.args[-1 if len(parts) == 1 else 1])
            most = None if limit is None else limit - 1
            times = limit
        if times is None:
            times = self.program.bound_of(ast.unparse(call.args[1 if len(parts) > 1 else 0]))
            if times is None and self.wanted is None:
                times = 1  # what is known by the next pass may tell
            if times is None:
                raise self.scope.fail(node.iter, "has no bound that is known")
            guard, most = f" && ({counter} < {times})", times - 1
        self.scope.names[name.id] = Value(counter, INT)
        if most is not None:
            self.scope.most[name.id] = most
        test = f"{counter} {'<' if step > 0 else '>'} {stop.within(UNARY - 1)}"
        test = f"({test}){guard}" if guard else test
        self._line(f"for (int {counter} = {start.code}; {test}; {'++' if step > 0 else '--'}{counter}) {{")
        self._repeated(node.body, times)

    def _most(self, node: ast.expr) -> int | None:
        """The largest that a whole number can be, where that is known."""
        if isinstance(node, ast.Name) and node.id in self.scope.most:
            return self.scope.most[node.id]
        if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub)):
            one, other = self._most(node.left), self._most(node.right)
            exact = isinstance(node.right, ast.Constant)
            if one is not None and other is not None and (isinstance(node.op, ast.Add) or exact):
                return one + other if isinstance(node.op, ast.Add) else one - other
        value = self.scope.value(node)
        return value.known if value.is_known and value.type == INT else None

    def _while(self, node: ast.While) -> None:
        times = self.program.bound_of_while(self.scope.function, self._whiles)
        self._whiles += 1
        counter = f"turn_{self._whiles}"
        test = self.scope.value(node.test)
        self._line(f"for (int {counter} = 0; ({counter} < {times}) && {test.within(UNARY - 1)}; ++{counter}) {{")
        self._repeated(node.body, times)

    def _return(self, node: ast.Return) -> None:
        if node.value is None:
            self._line("return;")
            return
        value = self.program.whole(self.scope.value(node.value))
        assert value.type is not None
        self.result = wider(self.result, value.type)
        self._line(f"return {self.program.convert(value, self.result).code};")

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
