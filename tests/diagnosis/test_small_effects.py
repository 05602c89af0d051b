"""What is too small to matter: nothing that leaves a record unexplained."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.units import RAD_S_PER_RPM
from tests.diagnosis.simulated import log_of

# A minute's coast-down, a seventh of the usual gain: its Stribeck speed is a guess, and what matters goes with it.
_LARGE = PlantParameters(motor_gain=2.3, viscous=0.018, coulomb=0.103, static=0.113)


@pytest.mark.slow
@pytest.mark.parametrize(("deflection_rad", "seed"), [(0.0, 1), (0.01, 5), (0.03, 1), (0.1, 8)])
def test_a_bristle_is_named_where_nothing_else_leaves_noise(deflection_rad: float, seed: int) -> None:
    """A large wheel read to 0.3 rpm: without a bristle adequate, with one it is named, and nothing beside it.

    A Stribeck speed that the fit made for want of the bristle, four times too high or a tenth of it, was the measure of
    what is too small to matter, and its way back to the truth was called another curve.
    """
    draws, time_s = np.random.default_rng(seed), np.arange(0.0, 900.0, 0.1)
    levels = np.repeat(draws.uniform(-0.54, 0.54, 60), 150)
    current_A = np.where(np.arange(time_s.size) // 150 % 3 == 2, 0.06 * levels, levels)
    wheel = _LARGE._replace(presliding_rad=deflection_rad, presliding_damping=0.4)
    run = simulate_run(wheel, current_A, time_s, PlantNoise(0.3 * RAD_S_PER_RPM), seed=seed)
    verdict = diagnose_log(log_of(run)).document()["verdict"]
    assert verdict["effects"] == (["presliding_hysteresis"] if deflection_rad > 0.0 else [])
    assert verdict["kind"] == ("effect" if deflection_rad > 0.0 else "adequate")
