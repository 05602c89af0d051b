"""Structure beside the four parameters: noticed whatever noise would explain it, and not seen where there is none."""

from __future__ import annotations

import pytest

from rw_ekf.filter.consistency import STRUCTURE_P, Consistency
from rw_ekf.likelihood.log_fit import consistency_of_fit
from tests.likelihood.wandering import wandering_setup

pytestmark = pytest.mark.xdist_group("wandering")  # the records are looked at once


def judged(profile: str, seed: int, torque_noise_rpm: float, offset_share: float = 0.0) -> Consistency:
    """Judge a run as `replay` and `fit` do, at the record's own noises."""
    _, _, setup = wandering_setup(profile, seed, torque_noise_rpm, offset_share)
    assert setup.fit_of_record is not None
    return consistency_of_fit(setup.fit_of_record, setup.constants)


@pytest.mark.parametrize("torque_noise_rpm", [0.0, 0.1])
@pytest.mark.parametrize("profile", ["P1", "P2"])
def test_an_undeclared_offset_is_not_explained_away_by_torque_noise(profile: str, torque_noise_rpm: float) -> None:
    """An offset of 5 % of Coulomb friction is seen at the noises that fit the log best; no word on tuning is said."""
    for seed in range(3):
        found = judged(profile, seed, torque_noise_rpm, 0.05)
        assert found.structure_p is not None
        assert found.structure_p < STRUCTURE_P
        assert found.is_noise is False
        (stated,) = found.warnings()
        assert "rw-ekf diagnose" in stated
        assert "--noise" not in stated


@pytest.mark.slow
@pytest.mark.parametrize("torque_noise_rpm", [0.0, 0.03, 0.1])
@pytest.mark.parametrize("profile", ["P1", "P2", "S2", "S4", "S5", "creep", "weak sine"])
def test_healthy_wheels_have_no_structure(profile: str, torque_noise_rpm: float) -> None:
    """None of eight healthy wheels is accused, whatever its torque noise; whiteness and mean hold as well."""
    for seed in range(8):
        assert judged(profile, seed, torque_noise_rpm).is_noise is not False
