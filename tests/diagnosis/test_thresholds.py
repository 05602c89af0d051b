"""The table of numbers that decide: complete, documented, and used."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from rw_ekf.diagnosis import thresholds
from rw_ekf.diagnosis.thresholds import TABLE
from tests.live.bench import ROOT
from tools.measure.thresholds import Moved, compared, other_value, sentence_about


def test_every_number_of_the_module_is_in_the_table_and_the_other_way_round() -> None:
    """No number decides unseen, and a row is the number that is used."""
    named = {name: value for name, value in vars(thresholds).items() if name.isupper() and name != "TABLE"}
    assert named == {name: row.value for name, row in TABLE.items()}
    assert len(TABLE) < 60
    assert all(row.decides and row.source for row in TABLE.values())


def test_nothing_stands_in_the_table_that_nothing_depends_on() -> None:
    """Each is read somewhere in the diagnosis."""
    modules = [path for path in (ROOT / "rw_ekf").rglob("*.py") if path.name != "thresholds.py"]
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in modules]
    read = {node.id for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Name)}
    assert set(TABLE) <= read


def test_the_page_has_each_with_its_value() -> None:
    """docs/thresholds.md, as the tool writes it."""
    page = (Path(ROOT) / "docs" / "thresholds.md").read_text(encoding="utf-8")
    reported = dict(re.findall(r"^\| `(\w+)` \| ([^|]+) \|", page, re.MULTILINE))
    assert reported == {name: f"{row.value:.3g}" for name, row in TABLE.items()}


def test_a_third_less_of_a_count_is_one_less_and_of_a_p_value_its_exponent() -> None:
    """Else a beam of two would be 1.4, and a p of 1e-4 hardly another."""
    assert other_value("BEAM", 0.7) == 1.0
    assert other_value("BEAM", 1.3) == 3.0
    assert abs(other_value("SIGNIFICANT_P", 1.3) - 10.0**-5.2) < 1e-9
    assert other_value("LEAST_SIGMAS", 0.7) == 0.7 * thresholds.LEAST_SIGMAS
    assert other_value("EXPLAINED_SHARE", 1.3) == 0.9


def test_logs_are_told_that_end_otherwise() -> None:
    """Lost, won, and called by another name."""
    usual = {"a": (True, ("effect", "x")), "b": (False, ("adequate",)), "c": (True, ("effect", "y"))}
    found = {"a": (False, ("adequate",)), "b": (True, ("effect", "x")), "c": (True, ("effect", "z"))}
    moved = compared(usual, found, 1.0)
    assert moved == Moved(1.0, 2, ["a"], ["b"], ["c"])
    assert sentence_about(moved._asdict()) == "-1 +1, 1 renamed"
