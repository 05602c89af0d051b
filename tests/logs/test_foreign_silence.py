"""Logs that were read in a wrong meaning without a word: each is read in the right one, or asked about."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import rw_ekf
from rw_ekf.units import RAD_S_PER_RPM

RPM = 1.0 / RAD_S_PER_RPM


@pytest.fixture(scope="module")
def run() -> rw_ekf.Log:
    """60 s of a simulated wheel at 10 Hz, in both directions."""
    return rw_ekf.simulate("steps", duration_s=60.0, seed=6)


def _csv(log: rw_ekf.Log, header: str, line: Callable[[int, float, float, float], str]) -> str:
    rows = zip(log.time_s.tolist(), log.speed_rad_s.tolist(), log.current_A.tolist(), strict=True)
    return header + "\n" + "".join(line(i, t, w, c) + "\n" for i, (t, w, c) in enumerate(rows))


def _guess(path: Path, text: str) -> rw_ekf.GuessedColumns:
    path.write_text(text)
    return rw_ekf.guess_columns(path)


@pytest.mark.parametrize(
    "names",
    ["P,I,D", "p,i,d", "P,I,u", "pid_p,pid_i,pid_d", "vel_p,vel_i,u", "P Term,I Term,D Term", "psi,psi_i,u",
     "kp_err,i_err,u", "axisP[0],axisI[0],axisD[0]", "u,pid.i,x"],
)  # fmt: skip
def test_what_a_controller_has_integrated_is_no_current(tmp_path: Path, run: rw_ekf.Log, names: str) -> None:
    """`I` beside `P` and `D` is a controller's, by its name or by what stands beside it: asked, and never amperes."""
    text = _csv(run, f"t_s,rpm,{names}", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c + 0.01 * w!r},{c!r},{c - i / 1e3!r}")
    found = _guess(tmp_path / "a.csv", text)
    assert "current_A" in [question.name for question in found.guess.questions], found.guess.mapping()
    beside = "\n".join(f"{row},{0.5 + k % 7}" if k else f"{row},i_motor" for k, row in enumerate(text.splitlines()))
    assert _guess(tmp_path / "b.csv", beside).guess.mapping()["current_A"] == {"column": "i_motor"}


@pytest.mark.parametrize(
    "names",
    ["i_q,p_q,x", "I_motor,P_motor,x", "I,x,y", "motor_i,motor_v,x", "I,U,P", "I,V,P", "i_q,i_d,u", "I,P [W],x"],
)
def test_an_i_that_no_controller_stands_beside_is_a_current(tmp_path: Path, run: rw_ekf.Log, names: str) -> None:
    """Beside a voltage, `P` is a power; an `I` alone, of a motor or of an axis, is a current as before."""
    text = _csv(run, f"t_s,rpm,{names}", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r},{c + 0.01 * w!r},{c - i / 1e3!r}")
    assert _guess(tmp_path / "a.csv", text).guess.mapping()["current_A"] == {"column": names.split(",", 1)[0]}


_TWINCAT = """Name\tScope
File\tD:\\rw.csv


Name\tramp\tName\tActCurrent\tSetCurrent\tVdc\tActVelo
SymbolComment\t\tSymbolComment
Data-Type\tREAL32\tData-Type\tREAL32\tREAL32\tINT16\tREAL64
SampleTime[ms]\t0,2\tSampleTime[ms]\t100\t100\t100\t100
VariableSize\t4\tVariableSize\t4\t4\t2\t8
SymbolBased\tTrue\tSymbolBased\tTrue\tTrue\tTrue\tTrue
Port\t851\tPort\t851\t851\t851\t851
Offset\t0\tOffset\t0\t0\t0\t0
ScaleFactor\t1\tScaleFactor\t1\t1\t1\t1
BitMask\t0xff\tBitMask\t0xff\t0xff\t0xff\t0xff
Unit\t(None)\tUnit\tmA\tA\tV (Voltage)\trpm
Unit ScaleFactor\t1\tUnit ScaleFactor\t1\t1\t1\t1
Unit Offset\t0\tUnit Offset\t0\t0\t0\t0
"""


@pytest.mark.parametrize("rows", [8, 30, 60, 80, 99, 200])
def test_units_stand_over_their_columns_in_few_rows_too(tmp_path: Path, run: rw_ekf.Log, rows: int) -> None:
    """Names, units and rows are cut at the same marks however few rows there are: no mA is read as an A."""
    log = [f"{100 * i}\t{i}\t{100 * i}\t{651 + i % 9}\t{6 + i % 3}\t24\t{1 + i % 37}" for i in range(rows)]
    found = _guess(tmp_path / "a.csv", _TWINCAT + "\n" + "\n".join(log) + "\n").guess.mapping()
    assert found["current_A"] == {"column": "ActCurrent [mA]", "unit": "mA"}
    assert found["current_command_A"] == {"column": "SetCurrent [A]"}
    assert found["speed_rpm"] == {"column": "ActVelo [rpm]"}


def test_cells_between_tabs_are_not_cut_at_blanks(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Where tabs stand between all cells of all rows, a blank in a name or a unit cuts nothing."""
    head = "# of the bench\nt (s)\tVdc actual (V)\tspeed (rpm)\tI mot (mA)"
    text = _csv(run, head, lambda i, t, w, c: f"{t!r}\t24\t{w * RPM!r}\t{1e3 * c!r}")
    found = _guess(tmp_path / "a.csv", text).guess.mapping()
    assert found["current_A"] == {"column": "I mot (mA)", "unit": "mA"}
