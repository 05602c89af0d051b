"""Logs as benches, drives and hobby projects write them: read in the right meaning, or asked with answers that work."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import rw_ekf
from rw_ekf.logs.odd_columns import turn_of
from rw_ekf.units import RAD_S_PER_RPM

RPM = 1.0 / RAD_S_PER_RPM
Formula = Callable[[float, float, float], float]


@pytest.fixture(scope="module")
def run() -> rw_ekf.Log:
    """30 s of a simulated wheel at 10 Hz, in both directions."""
    return rw_ekf.simulate("steps", duration_s=30.0, seed=8)


def _asked(path: Path, run: rw_ekf.Log, header: str, *further: Formula) -> tuple[rw_ekf.GuessedColumns, str]:
    """What is found of a log of time, speed [rpm], current and further columns, of these; and what is asked."""
    rows = zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)
    cells = ((t, w * RPM, i, *(formula(t, w, i) for formula in further)) for t, w, i in rows)
    path.write_text("\n".join([header, *(",".join(map(repr, row)) for row in cells)]) + "\n")
    found = rw_ekf.guess_columns(path)
    return found, " ".join(question.text for question in found.guess.questions)


def test_a_noisy_angle_that_goes_beyond_its_turn_begins_anew_all_the_same() -> None:
    """Its jumps say so; counts of a turn are told apart by a hundredth still."""
    true = np.cumsum(np.linspace(40.0, 12.0, 900))
    noise = np.random.default_rng(3).normal(0.0, 2.0, true.size)
    angle = true % 360.0 + noise
    assert np.ptp(angle) > 360.0
    assert turn_of(angle) == 360.0
    assert turn_of(np.radians(angle), (2.0 * math.pi,), only=True) == 2.0 * math.pi
    assert turn_of(true + noise) is None
    assert turn_of((true * 10.0) % 4000.0, (4096.0,)) == 4000.0


def test_an_angle_that_goes_half_a_turn_between_rows_is_asked_about(tmp_path: Path) -> None:
    """Which way around it went nobody knows then."""

    def asked(step_deg: float) -> str:
        rows = (f"{i / 10!r},{round(step_deg * i % 360.0, 2)!r},{math.sin(i)!r}" for i in range(100))
        (tmp_path / "a.csv").write_text("\n".join(["t_s,angle_deg,i_A", *rows]))
        return " ".join(question.text for question in rw_ekf.guess_columns(tmp_path / "a.csv").guess.questions)

    assert "half a turn" in asked(201.0)
    assert not asked(31.0)


def test_a_row_of_dates_is_no_row_of_names(tmp_path: Path) -> None:
    """The first of a file without names is a row as all others; its columns have numbers."""
    rows = [f"2024-03-0{1 + i // 60} 10:{i % 60:02d}:00,{100.0 - 0.5 * i!r}" for i in range(100)]
    (tmp_path / "a.csv").write_text("\n".join(rows))
    table = rw_ekf.guess_columns(tmp_path / "a.csv")
    assert any("a number from 0 to 1" in note for note in table.guess.notes)
    assert {line.entry.get("column") for line in table.guess.lines} <= {0, 1}


def test_what_a_vesc_calls_rpm_is_electrical(tmp_path: Path, run: rw_ekf.Log) -> None:
    """As its library for microcontrollers passes it on, whatever it is called."""
    rows = [
        {
            "rpm": round(w * RPM * 7),
            "t": t,
            "avgMotorCurrent": i,
            "dutyCycleNow": w / 400.0,
            "inpVoltage": 12.0 - 0.1 * i,
        }
        for t, w, i in zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)
    ]
    (tmp_path / "a.jsonl").write_text("\n".join(map(json.dumps, rows)))
    asked = [question.text for question in rw_ekf.guess_columns(tmp_path / "a.jsonl").guess.questions]
    assert len(asked) == 1
    assert "pole pairs" in asked[0]
