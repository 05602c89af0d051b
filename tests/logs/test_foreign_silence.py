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
