"""The scale for stated probabilities: what holds passes, what is too sure does not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tools.proof.judge import Record, record_of
from tools.proof.marks import cases_of
from tools.proof.reliability import Statement, calibration_error, likeliest_statements, reliability_table, statements


def record(number: int, posterior: dict[str, float], mark: str = "id-1rpm") -> Record:
    """A case of the proof with a verdict that states these probabilities."""
    verdict: dict[str, Any] = {"kind": "effect", "effects": [], "indistinguishable": [], "statement": "so it is"}
    case = cases_of(mark, number + 1, 1)[number]
    return record_of(case, {"verdict": {**verdict, "posterior": posterior}}, 1.0, detectable=True, table_ratio=None,
                     excess_chi_square=None)  # fmt: skip


def test_probabilities_that_hold_have_no_calibration_error_and_ones_too_sure_have_theirs() -> None:
    """Drawn truths of 4,000 statements: within chance of 0 where they hold, the surplus where 0.9 means 0.7."""
    rng = np.random.default_rng(3)
    chances = rng.uniform(0.0, 1.0, 4000)
    held = [Statement(float(p), bool(rng.random() < p)) for p in chances]
    assert calibration_error(held) < 0.03
    too_sure = [Statement(0.9, bool(rng.random() < 0.7)) for _ in chances]
    assert calibration_error(too_sure) == pytest.approx(0.2, abs=0.03)


def test_a_statement_is_judged_by_what_the_wheel_was_given() -> None:
    """An effect, nothing, and something of no catalogue are each true of their own wheels alone."""
    remarked = {"offset_torque": 0.6, "none": 0.3, "something_else": 0.1}
    offset, healthy, outside = record(0, remarked), record(0, remarked, "healthy"), record(0, remarked, "outside")
    assert offset.expected == ["offset_torque"]
    assert [item.true for item in statements(offset)] == [True, False, False]
    assert [item.true for item in statements(healthy)] == [False, True, False]
    assert [item.true for item in statements(outside)] == [False, False, True]
    assert [item.stated for item in likeliest_statements([offset, healthy])] == [0.6, 0.6]
    _, rows = reliability_table([offset, healthy, outside])
    assert sum(int(row[1]) for row in rows[:-1]) == 9
