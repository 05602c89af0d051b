"""The shipped maps on the measured records; skipped where the records are not at hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rw_ekf.logs.reader import read_log
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.settings.resources import config_directory

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the measured records (../shared/data) are not here")


def read(record: str, columns: str) -> WheelLog:
    return read_log(DATA / record, config_directory() / f"columns-{columns}.yaml")


def test_emps_csv_and_original_agree() -> None:
    """Proves that the speed derived from the 1 kHz positions is the one of the 100 Hz copy, up to its averaging."""
    fine, coarse = read("emps/DATA_EMPS.mat", "emps-mat"), read("emps/DATA_EMPS_100Hz.csv", "emps")
    assert fine.rate_hz == pytest.approx(1000, rel=1e-3)
    assert coarse.rate_hz == pytest.approx(100, rel=1e-3)
    middle_s = coarse.time_s[1:] - 0.005  # a backward difference belongs to the middle of its step
    derived = np.interp(middle_s, fine.time_s[1:] - 0.0005, fine.speed_rad_s[1:])
    assert np.sqrt(np.mean((derived - coarse.speed_rad_s[1:]) ** 2)) < 1e-3
    assert coarse.drive == fine.drive == "current_command_A"
    assert coarse.current_A[0] == pytest.approx(fine.current_A[:10].mean(), rel=1e-4)


def test_odrive_csv_and_original_agree() -> None:
    """Proves that cells are joined into 50 segments, and that decimation comes near the 100 Hz copy."""
    name = "odrive_cogging/accel_tests/spinup_5_nocomp"
    fine, coarse = read(f"{name}.mat", "odrive-mat"), read(f"{name}_100Hz.csv", "odrive")
    for log in (fine, coarse):
        assert log.segment[-1] == 49
        assert log.drive == "current_A"
        assert np.isnan(log.speed_rad_s).sum() == 50
        assert log.skipped_rows == 0
    assert fine.rate_hz == pytest.approx(100, rel=0.03)
    assert np.nanmax(fine.speed_rad_s) == pytest.approx(np.nanmax(coarse.speed_rad_s), rel=0.02)
