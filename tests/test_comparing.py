"""What holds arrays is never compared member by member: `==` and `in` of it would ask an array for its truth."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from rw_ekf.filter.belief import DEFAULT_PRIOR, Belief
from rw_ekf.filter.filter_run import History

ROOT = Path(__file__).parents[1]


def _classes() -> Iterator[tuple[Path, ast.ClassDef]]:
    for folder in ("rw_ekf", "drivers", "tools"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ClassDef):
                    yield path, node


def test_every_class_that_holds_an_array_equals_itself_alone() -> None:
    """No dataclass and no named tuple with an array among its fields has the comparison that its kind would give it."""
    compared, held = [], 0
    for path, node in _classes():
        fields = [ast.unparse(line.annotation) for line in node.body if isinstance(line, ast.AnnAssign)]
        if not any(re.search(r"Array\b|\bnd?array", field) for field in fields):
            continue
        decorators = [ast.unparse(decorator) for decorator in node.decorator_list]
        dataclass = next((text for text in decorators if text.startswith("dataclass")), None)
        named_tuple = any("NamedTuple" in ast.unparse(base) for base in node.bases)
        held += dataclass is not None or named_tuple
        if (dataclass is not None and "eq=False" not in dataclass) or (named_tuple and "by_identity" not in decorators):
            compared.append(f"{path.relative_to(ROOT)}:{node.lineno} {node.name}")
    assert compared == []
    assert held > 50


def test_two_of_equal_content_are_told_apart_without_asking_an_array() -> None:
    """A belief and a named tuple equal themselves, not their copies, and can be looked for in lists and sets."""
    twin = Belief(DEFAULT_PRIOR.mean.copy(), DEFAULT_PRIOR.covariance.copy())
    one, other = (History(*(np.zeros(3) for _ in History._fields)) for _ in range(2))
    for a, b in ((DEFAULT_PRIOR, twin), (one, other)):
        assert a == a  # noqa: PLR0124
        assert a != b
        assert b not in [a]
        assert [a, b].index(b) == 1
        assert len({a, b}) == 2
