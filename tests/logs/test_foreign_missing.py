"""What stands in a file where nothing was measured is a gap, and never a reading."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rw_ekf
from rw_ekf.logs.odd_columns import mark_of_missing
from rw_ekf.units import RAD_S_PER_RPM


@pytest.fixture(scope="module")
def run() -> rw_ekf.Log:
    """60 s of a simulated wheel at 10 Hz, in both directions."""
    return rw_ekf.simulate("steps", duration_s=60.0, seed=7)


def _csv(run: rw_ekf.Log, header: str, mark: str, every: int = 40) -> str:
    """Speeds in rpm and currents in A, with a mark in place of each so many of both; the temperature always has it."""
    rows = []
    for i, (t, w, c) in enumerate(
        zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)
    ):
        missing = i % every == 9
        cells = (mark, mark) if missing else (f"{w / RAD_S_PER_RPM:.6f}", f"{c:.6f}")
        rows.append(f"{t!r},{','.join(cells)},{mark if i % 7 == 3 else '21.5'}")
    return "\n".join([header, *rows, ""])


@pytest.mark.parametrize(
    "mark",
    ["---", "--", "\u2014", "\u221e", "-\u221e", "-9999", "-9999.0", "99999", "9.91E+37", "1e+30", "-32768", "65535"],
)
def test_a_mark_is_a_gap(tmp_path: Path, run: rw_ekf.Log, mark: str) -> None:
    """Dashes, an oscilloscope's over-range, and numbers that only stand for no number, in speed and current alike."""
    path = tmp_path / "a.csv"
    path.write_text(_csv(run, "t_s,speed_rpm,current [A],temperature [degC]", mark), encoding="utf-8")
    log, out = rw_ekf.read(path), tmp_path / "map.yaml"
    gaps = np.arange(len(run)) % 40 == 9
    assert np.array_equal(np.isnan(log.speed_rad_s), gaps | np.isnan(run.speed_rad_s))
    assert log.speed_rad_s[~gaps] == pytest.approx(run.speed_rad_s[~gaps], abs=1e-6, nan_ok=True)
    assert float(np.max(np.abs(log.current_A))) < 1.01 * float(np.max(np.abs(run.current_A)))
    out.write_text(rw_ekf.guess_columns(path).text())
    assert np.array_equal(rw_ekf.read(path, out).speed_rad_s, log.speed_rad_s, equal_nan=True)


def test_a_log_of_its_own_names_is_said_to_hold_one(tmp_path: Path, run: rw_ekf.Log) -> None:
    """No map is guessed there: the sentence has the line that makes gaps of it."""
    path = tmp_path / "a.csv"
    path.write_text(_csv(run, "time_s,speed_rpm,current_A,temperature_degC", "-9999"))
    log = rw_ekf.read(path)
    assert any("missing: -9999" in fault for fault in log.faults)


def test_what_a_machine_passes_is_a_reading() -> None:
    """A speed of 9999 between its neighbours, a drive of few levels, a drive to both ends, one 999."""
    ramp = np.linspace(-9999.0, 9999.0, 401)
    bang = np.where(np.arange(400) % 40 < 8, 999.0, 0.0)
    ends = np.concatenate([np.linspace(-500.0, 500.0, 400), [-9999.0, 9999.0]])
    once = np.concatenate([np.linspace(-500.0, 500.0, 400), [999.0]])
    assert [mark_of_missing(values) for values in (ramp, bang, ends, once)] == [None] * 4
    assert mark_of_missing(np.append(once, 999.0)) == 999.0


def test_no_line_is_a_row_for_its_dashes(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A rule below the names, and one in the middle, hold no row."""
    path = tmp_path / "a.txt"
    text = _csv(run, "t_s,speed_rpm,current [A],temperature [degC]", "---")
    lines = text.split("\n")
    path.write_text("\n".join([lines[0], "---,---,---,---", *lines[1:300], "---,---,---,---", *lines[300:]]))
    assert len(rw_ekf.read(path)) == len(run)
