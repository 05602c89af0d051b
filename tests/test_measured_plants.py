"""Measured machines through their column maps: what the four-parameter model gets right, and that it says what not."""

from __future__ import annotations

from pathlib import Path

import pytest

from rw_ekf.logs.column_map import load_column_map
from rw_ekf.logs.reader import read_log
from rw_ekf.replay import replay_log
from rw_ekf.settings.resources import config_resource

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the measured records (../shared/data) are not here")


@needs_data
def test_the_carriage_has_its_published_mass_and_friction() -> None:
    """EMPS at 1 kHz: mass to 2 %, friction to 5 % of what is published, and a residual that is not noise."""
    log = read_log(str(DATA / "emps" / "DATA_EMPS.mat"), load_column_map(config_resource("columns-emps-mat")))
    replayed = replay_log(log)
    gain, viscous, coulomb, _ = replayed.belief.parameters
    mass_kg = 1.0 / gain
    assert mass_kg == pytest.approx(95.109, rel=0.02)
    assert viscous * mass_kg == pytest.approx(203.5, rel=0.05)
    assert coulomb * mass_kg == pytest.approx(20.39, rel=0.05)
    assert replayed.consistency.is_noise is False
    assert any("does not look like the default wheel" in text for text in replayed.warnings)


@needs_data
def test_the_bare_rotor_has_one_motor_gain_whatever_its_cogging() -> None:
    """Trials of one rotor agree in motor gain: two alike to 3 %, with cogging compensated in the drive to 15 %."""
    gains = {}
    columns = load_column_map(config_resource("columns-odrive"))
    for trial in ("3_comp", "4_nocomp", "5_nocomp"):
        path = DATA / "odrive_cogging" / "accel_tests" / f"spinup_{trial}_100Hz.csv"
        replayed = replay_log(read_log(str(path), columns))
        gains[trial] = replayed.belief.parameters.motor_gain
        assert replayed.consistency.is_noise is False
    assert gains["4_nocomp"] == pytest.approx(gains["5_nocomp"], rel=0.03)
    assert gains["3_comp"] == pytest.approx(gains["4_nocomp"], rel=0.15)
