"""Numbers by simulation: those of an independent output-error fit, and nothing moved where a model lacks nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import least_squares

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.filter.constants import filter_constants
from rw_ekf.likelihood.by_simulation import by_simulation, error_of_run
from rw_ekf.likelihood.fitting import Fit, fit_model
from rw_ekf.likelihood.gauss_newton import Problem, Start
from rw_ekf.likelihood.linearisation import Noise
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import Record, Trajectory
from rw_ekf.model.friction import GAUSS, Stribeck
from rw_ekf.model.state import FrictionParameters

GAIN, VISCOUS, COULOMB = 40.0, 0.3, 6.0
PERIOD_S, NOISE_RAD_S = 0.1, 0.05
SLOW = Stribeck(0.5, GAUSS)


def exact(k: float, b: float, c: float, omega: float, current_A: Float64Array) -> Float64Array:
    """Speeds of a wheel that never comes near rest: omega' = k I - b omega - c, each interval by its closed form."""
    out, decay = np.empty(current_A.size), math.exp(-b * PERIOD_S)
    for i, current in enumerate(current_A):
        out[i] = omega
        end = (k * current - c) / b
        omega = end + (omega - end) * decay
    return out


def machine(lacking: float) -> tuple[Float64Array, Float64Array]:
    """Currents and readings (1500,) of a wheel whose gain falls with the current by a share that no model has."""
    random = np.random.default_rng(5)
    current = np.repeat(random.uniform(0.5, 1.5, 75), 20)
    speed = exact(GAIN, VISCOUS, COULOMB, 100.0, current * (1.0 - lacking * (current - 1.0)))
    return current, speed + NOISE_RAD_S * random.standard_normal(current.size)


def likeliest(current: Float64Array, reading: Float64Array) -> Fit:
    time_s = PERIOD_S * np.arange(reading.size, dtype=np.float64)
    record = Record.of(
        Course.of(time_s, reading, np.asarray(current, dtype=np.float64)),
        np.ones(reading.size, bool),
        filter_constants(SLOW.omega_s),
    )
    model = Model(FrictionParameters(GAIN, VISCOUS, COULOMB, 1.2 * COULOMB), SLOW)
    path = Trajectory.of_speed(reading.copy(), np.full(reading.size, NOISE_RAD_S))
    omit = np.zeros(reading.size, bool)
    return fit_model(Problem(record, None, omit), Start(model, path, Noise(NOISE_RAD_S**2, 1.0)))


def test_they_are_those_of_an_output_error_fit_by_closed_form() -> None:
    """A gain that falls with the current is no noise: the numbers are scipy's, whose model is the exact solution."""
    current, reading = machine(0.2)
    fit = likeliest(current, reading)
    found = by_simulation(fit)

    def missed(p: Float64Array) -> Float64Array:
        return exact(float(p[0]), float(p[1]), float(p[2]), float(p[3]), current) - reading

    best = least_squares(missed, [GAIN, VISCOUS, COULOMB, reading[0]], x_scale=[10.0, 0.1, 1.0, 1.0])
    assert found.simulated
    assert np.all(np.abs(found.model.vector[:3] - best.x[:3]) < 0.1 * fit.std[:3])
    assert np.any(np.abs(fit.model.vector[:3] - best.x[:3]) > 0.5 * fit.std[:3])  # else nothing is asked here
    missed_by = [float(np.sqrt(np.mean(error_of_run(fit, one.model) ** 2))) for one in (found, fit)]
    assert missed_by[0] == pytest.approx(float(np.sqrt(np.mean(best.fun**2))), rel=0.01)
    assert missed_by[0] < missed_by[1]


def test_nothing_moves_by_much_where_the_model_lacks_nothing() -> None:
    """With readings' noise alone both ways of asking give the same, to half a standard deviation."""
    fit = likeliest(*machine(0.0))
    moved = by_simulation(fit).model.vector[:3] - fit.model.vector[:3]
    assert np.all(np.abs(moved) < 0.5 * fit.std[:3])


def test_it_takes_no_less_to_start_than_to_keep_going() -> None:
    """A wheel that never rests tells nothing of break-away friction: it stays at Coulomb friction or above."""
    found = by_simulation(likeliest(*machine(0.2))).model.parameters
    assert found.static >= found.coulomb
