"""Every fault of the list has a test that says so."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from tests.faults.test_bus_rows import OF_ONE_WHEEL, OF_THE_LINE

ROWS = set(range(1, 31))
WITHOUT_A_TEST: set[int] = set()
OF_ONE_FAMILY = {  # rows that are tried with one family of wheels alone, and why
    20: "spikes are judged by the filter, behind the driver",
    21: "the wall clock is the loop's",
    22: "so are steps of time",
    25: "the process and its supervisor, whatever is on the line",
    26: "the disk",
    27: "files, and a supervisor",
    28: "files",
    29: "the watchdog of the loop",
}


def test_every_row_of_the_list_is_held_by_a_test() -> None:
    """Test functions whose docstring begins "Row N:" or "Row N, M:", of all tests; none is missing but those named."""
    held = {row for row, _ in rows_and_tests()}
    assert held <= ROWS
    assert ROWS - held == WITHOUT_A_TEST


def test_every_row_is_held_for_each_family_of_wheels_but_those_named() -> None:
    """A test of each other row is one of every family; a reason stands by those that are not."""
    of_each = {row for row, each in rows_and_tests() if each}
    assert ROWS - of_each == set(OF_ONE_FAMILY)


def test_every_row_is_held_on_a_line_of_several_wheels() -> None:
    """By the rows of `test_bus_rows.py`, and by the tests whose docstring begins "On a line, row N:"; none is left."""
    named = {int(row.split()[0]) for row in (*OF_ONE_WHEEL, *OF_THE_LINE)}
    texts = (path.read_text(encoding="utf-8") for path in Path(__file__).parents[1].rglob("test_bus*.py"))
    reported = {int(number) for text in texts for number in re.findall(r'"""On a line, row (\d+):', text)}
    assert named | reported == ROWS
    assert not named & reported


def rows_and_tests() -> Iterator[tuple[int, bool]]:
    """Rows by the docstrings of tests, and whether the test, or its module or fixture, names the families."""
    for path in Path(__file__).parents[1].rglob("test_*.py"):
        module = ast.parse(path.read_text(encoding="utf-8"))
        fixtures = [node for node in module.body if isinstance(node, ast.FunctionDef) and "fixture" in _marks(node)]
        marks = [node for node in module.body if isinstance(node, ast.Assign)]
        whole = any("FAMIL" in text for text in (*map(ast.dump, marks), *map(_marks, fixtures)))
        for node in ast.walk(module):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                match = re.match(r"Row ([\d, ]+):", ast.get_docstring(node) or "")
                for number in match[1].split(",") if match else ():
                    yield int(number), whole or "FAMIL" in _marks(node)


def _marks(node: ast.FunctionDef) -> str:
    return "".join(map(ast.dump, node.decorator_list))
