"""How far apart two explanations are on a motion, held against runs of the simulated plant."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from rw_ekf.arrays import Float64Array
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.settle.named_moves import Bounds, Move, currents
from rw_ekf.settle.predicted import Scene, divergences
from rw_ekf.settle.standing_explanations import Standing, standing_of_document
from rw_ekf.units import RAD_S_PER_RPM
from tests.settle.standing import STD, diagnosis, model

PERIOD_S = 0.1
BOUNDS = Bounds(current_A=0.4, step_A=0.4, speed_rad_s=200.0, period_s=PERIOD_S, ticks=600)
PUSHES = currents([Move("push", 2.0, 0.0, side * 0.3) for side in (1.0, -1.0, -1.0, 1.0)] * 8, CK13_STATISTICAL, BOUNDS)
FAST = currents([Move("turn", 30.0, side * 150.0, 0.2) for side in (1.0, -1.0)], CK13_STATISTICAL, BOUNDS)
KEYS = {
    "actuator_lag": "actuator_lag_s",
    "transport_delay": "transport_delay_s",
    "offset_torque": "offset_rad_s2",
    "viscous_asymmetry": "asymmetry_1_s",
}


def noiseless(name: str, p: Float64Array, current_A: Float64Array) -> Float64Array:
    """Speeds of the plant with four parameters and the coefficient of an effect."""
    plant = PlantParameters()._replace(motor_gain=p[0], viscous=p[1], coulomb=p[2], static=p[3])
    plant = plant._replace(**{KEYS[name]: float(p[4])})
    times = PERIOD_S * np.arange(1, current_A.size + 1)
    found: Float64Array = simulate_run(plant, current_A, times, PlantNoise(0.0), fine_step_s=5.0e-4).speed_rad_s
    return found


def whitened(speed: Float64Array, sigma: float, wander: float) -> Float64Array:
    """By the dense covariance of all readings: noise, and a speed that wanders at random, from rest."""
    index = np.arange(speed.size)
    walk = wander**2 * PERIOD_S * np.minimum.outer(index, index)
    root = np.linalg.cholesky(sigma**2 * np.eye(speed.size) + walk)
    found: Float64Array = np.linalg.solve(root, speed)
    return found


@pytest.mark.parametrize(
    ("true", "other", "current_A", "wander_rpm", "within"),
    [
        (("actuator_lag", 0.05, 0.002), ("transport_delay", 0.05, 0.002), PUSHES, 0.0, 0.25),
        (("transport_delay", 0.05, 0.002), ("actuator_lag", 0.05, 0.002), PUSHES, 0.03, 0.25),
        (("offset_torque", 0.006, 0.002), ("viscous_asymmetry", 0.0002, 0.0001), FAST, 0.0, 0.15),
        (("offset_torque", 0.01, 0.002), ("viscous_asymmetry", 0.0002, 0.0001), FAST, 0.05, 0.1),
    ],
)
def test_the_divergence_is_what_runs_of_both_wheels_show(
    true: tuple[str, float, float],
    other: tuple[str, float, float],
    current_A: Float64Array,
    wander_rpm: float,
    within: float,
) -> None:
    """Both simulated by the plant, the other's five numbers refitted as far as the first log lets them, whitened.

    A lag and a delay differ by 0.1 rpm here, and plant and filter reckon a lagging current to 0.04 rpm alike.
    """
    standing: Standing = standing_of_document(
        "here", diagnosis((0.5, model(true, wander_rpm=wander_rpm)), (0.5, model(other, wander_rpm=wander_rpm)))
    )
    first, second = sorted(standing.explanations, key=lambda item: item.effects != (true[0],))
    found = divergences(first, [second], Scene(standing, PERIOD_S), current_A)[0, -1]

    truth = noiseless(true[0], np.array([*CK13_STATISTICAL, true[1]]), current_A)
    stds = np.array([*STD, other[2]])
    centre = np.array([*CK13_STATISTICAL, other[1]])

    def misfit(x: Float64Array) -> Float64Array:
        off = truth - noiseless(other[0], centre + stds * x, current_A)
        return np.concatenate((whitened(off, RAD_S_PER_RPM, wander_rpm * RAD_S_PER_RPM), x))

    expected = least_squares(misfit, np.full(5, 0.1), diff_step=0.1).cost
    assert expected > 2.0
    assert found == pytest.approx(expected, rel=within)


def test_an_explanation_gains_nothing_over_itself() -> None:
    """The divergence of a model from the same one is zero at every time."""
    one = model(("actuator_lag", 0.05, 0.002))
    standing = standing_of_document("here", diagnosis((0.5, one), (0.5, one)))
    first, second = standing.explanations
    found = divergences(first, [second], Scene(standing, PERIOD_S), PUSHES)
    assert np.all(np.abs(found) < 1.0e-6)
