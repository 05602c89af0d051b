"""Statements of one Python function as C99; branches that this model never takes are left out."""

from __future__ import annotations

import ast

from rw_ekf.c_code.c_expressions import c_name
from rw_ekf.c_code.c_stores import Stores, assigned_names
from rw_ekf.c_code.c_types import INT, UNARY, Value, wider

_ENDS = (ast.Return, ast.Break, ast.Continue)
_WRITTEN_OUT = 8  # rounds of a loop; gcc alone does not write out two loops over a matrix: a pass took a tenth longer


class Body(Stores):
    """One pass over a function, block by block."""

    def run(self) -> None:
        """Print the body."""
        body = self.source.tree.body
        if isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
            self._reported = body[0].end_lineno or 0
            body = body[1:]
        else:
            self._reported = self.source.tree.body[0].lineno - 1
        self.ends = self._block(body)

    def _comment(self, node: ast.stmt) -> None:
        last = node.lineno if hasattr(node, "body") else (node.end_lineno or node.lineno)
        for line in range(self._reported + 1, last + 1):
            if line in self.source.comments:
                self._line(f"/* {self.source.comments[line].replace('*/', '* /')} */")
        self._reported = max(self._reported, last)

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
            self._reported = max(self._reported, (taken[0].lineno - 1) if taken else (node.end_lineno or 0))
            ended = self._block(taken)
            self._reported = max(self._reported, node.end_lineno or 0)
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
        ends = {part.id for part in ast.walk(call) if isinstance(part, ast.Name)}
        if ends & {other for part in node.body for other in assigned_names(part)}:
            raise self.scope.fail(node.iter, "would end elsewhere in C, for its loop changes it")
        parts = [self.scope.value(part) for part in call.args]
        start, stop = (self.program.number(0, INT), parts[0]) if len(parts) == 1 else (parts[0], parts[1])
        step = parts[2].known if len(parts) == 3 else 1
        if start.is_known and stop.is_known and len(range(start.known, stop.known, step)) == 0:
            self._reported = max(self._reported, node.end_lineno or 0)
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
        if times is not None and times <= _WRITTEN_OUT and not self.program.bounded:
            self._line(f"#pragma GCC unroll {_WRITTEN_OUT}")
        if times is None:
            times = self.program.bound_of(ast.unparse(call.args[1 if len(parts) > 1 else 0]))
            if times is None and self.wanted is None:
                times = 1  # what is known by the next pass may decide
            if times is None and self.program.bounded:
                raise self.scope.fail(node.iter, "has no bound that is known")
            if self.program.bounded and times is not None:
                guard, most = f" && ({counter} < {times})", times - 1
        self.scope.names[name.id] = Value(counter, INT)
        if most is not None:
            self.scope.most[name.id] = most
        test = f"{counter} {'<' if step > 0 else '>'} {stop.within(UNARY - 1)}"
        test = f"({test}){guard}" if guard else test
        self._line(f"for (int {counter} = {start.code}; {test}; {'++' if step > 0 else '--'}{counter}) {{")
        self._repeated(node.body, times or 1)

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
        return max(value.possible) if value.possible and value.type == INT else None

    def _while(self, node: ast.While) -> None:
        if not self.program.bounded:
            self._line(f"while ({self.scope.value(node.test).code}) {{")
            self._repeated(node.body, 1)
            return
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
