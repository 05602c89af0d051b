"""Every fault of the list has a test that says so."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROWS = set(range(1, 31))
WITHOUT_A_TEST: set[int] = set()


def test_every_row_of_the_list_is_held_by_a_test() -> None:
    """Test functions whose docstring begins "Row N:" or "Row N, M:", of all tests; none is missing but those named."""
    held: set[int] = set()
    for path in Path(__file__).parents[1].rglob("test_*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                match = re.match(r"Row ([\d, ]+):", ast.get_docstring(node) or "")
                held |= {int(number) for number in match[1].split(",")} if match else set()
    assert held <= ROWS
    assert ROWS - held == WITHOUT_A_TEST
