"""Machines that are no wheels through the shipped column maps: what is read, what the model gets right, what it lacks.

Each test has two sources: the measured records, skipped where they are not at hand, and simulated ones alike.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rw_ekf.log_replay import replay_log
from rw_ekf.logs.column_map_file import load_column_map
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.settings.resources import config_resource
from tests.rigs import write_carriage, write_rotor

MEASURED = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="module", params=["measured", "simulated"])
def records(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the records."""
    if request.param == "measured":
        if not MEASURED.is_dir():
            pytest.skip("the measured records (../shared/data) are not here")
        return MEASURED
    folder = tmp_path_factory.mktemp("records")
    write_carriage(folder / "emps")
    trials = folder / "odrive_cogging" / "accel_tests"
    write_rotor(trials, "3_comp", 3, compensated=True)
    write_rotor(trials, "4_nocomp", 4, compensated=False)
    write_rotor(trials, "5_nocomp", 5, compensated=False)
    return folder


def read(record: Path, columns: str) -> WheelLog:
    return read_log(record, load_column_map(config_resource(f"columns-{columns}")))


def test_the_carriage_s_original_and_its_copy_agree(records: Path) -> None:
    """The speed derived from the 1 kHz positions is the one of the 100 Hz copy, up to its averaging."""
    fine = read(records / "emps" / "DATA_EMPS.mat", "emps-mat")
    coarse = read(records / "emps" / "DATA_EMPS_100Hz.csv", "emps")
    assert fine.rate_hz == pytest.approx(1000, rel=1e-3)
    assert coarse.rate_hz == pytest.approx(100, rel=1e-3)
    middle_s = coarse.time_s[1:] - 0.005  # a backward difference belongs to the middle of its step
    derived = np.interp(middle_s, fine.time_s[1:] - 0.0005, fine.speed_rad_s[1:])
    assert np.sqrt(np.mean((derived - coarse.speed_rad_s[1:]) ** 2)) < 1e-3
    assert coarse.drive == fine.drive == "current_command_A"
    assert coarse.current_A[0] == pytest.approx(fine.current_A[:10].mean(), rel=1e-4)


def test_the_rotor_s_original_and_its_copy_agree(records: Path) -> None:
    """Cells are joined into 50 segments, and decimation comes near the 100 Hz copy."""
    trial = records / "odrive_cogging" / "accel_tests" / "spinup_5_nocomp"
    fine, coarse = read(trial.with_suffix(".mat"), "odrive-mat"), read(Path(f"{trial}_100Hz.csv"), "odrive")
    for log in (fine, coarse):
        assert log.segment[-1] == 49
        assert log.drive == "current_A"
        assert np.isnan(log.speed_rad_s).sum() == 50
        assert log.skipped_rows == 0
    assert fine.rate_hz == pytest.approx(100, rel=0.03)
    assert np.nanmax(fine.speed_rad_s) == pytest.approx(np.nanmax(coarse.speed_rad_s), rel=0.02)


@pytest.mark.slow
def test_the_carriage_has_its_published_mass_and_friction(records: Path) -> None:
    """Mass to 2 %, friction to 5 % of what is published (and simulated), and a residual that is not noise."""
    replayed = replay_log(read(records / "emps" / "DATA_EMPS.mat", "emps-mat"))
    gain, viscous, coulomb, _ = replayed.belief.parameters
    mass_kg = 1.0 / gain
    assert mass_kg == pytest.approx(95.109, rel=0.02)
    assert viscous * mass_kg == pytest.approx(203.5, rel=0.05)
    assert coulomb * mass_kg == pytest.approx(20.39, rel=0.05)
    assert replayed.consistency.is_noise is False
    assert any("does not look like the default wheel" in text for text in replayed.warnings)


@pytest.mark.slow
def test_the_bare_rotor_has_one_motor_gain_whatever_its_cogging(records: Path) -> None:
    """Trials of one rotor agree in motor gain: two alike to 3 %, with cogging compensated in the drive to 15 %."""
    gains = {}
    for trial in ("3_comp", "4_nocomp", "5_nocomp"):
        path = records / "odrive_cogging" / "accel_tests" / f"spinup_{trial}_100Hz.csv"
        replayed = replay_log(read(path, "odrive"))
        gains[trial] = replayed.belief.parameters.motor_gain
        assert replayed.consistency.is_noise is False
    assert gains["4_nocomp"] == pytest.approx(gains["5_nocomp"], rel=0.03)
    assert gains["3_comp"] == pytest.approx(gains["4_nocomp"], rel=0.15)
