"""Logs as benches, drives and hobby projects write them: read in the right meaning, or asked with answers that work."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path


import rw_ekf
from rw_ekf.units import RAD_S_PER_RPM

RPM = 1.0 / RAD_S_PER_RPM
Formula = Callable[[float, float, float], float]


def test_a_row_of_dates_is_no_row_of_names(tmp_path: Path) -> None:
    """The first of a file without names is a row as all others; its columns have numbers."""
    rows = [f"2024-03-0{1 + i // 60} 10:{i % 60:02d}:00,{100.0 - 0.5 * i!r}" for i in range(100)]
    (tmp_path / "a.csv").write_text("\n".join(rows))
    table = rw_ekf.guess_columns(tmp_path / "a.csv")
    assert any("a number from 0 to 1" in note for note in table.guess.notes)
    assert {line.entry.get("column") for line in table.guess.lines} <= {0, 1}
