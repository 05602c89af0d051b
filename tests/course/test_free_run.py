"""A free run: its sensitivity is its derivative, static effects included; effects that are nothing change nothing."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.course.free_run import FreeRun, free_run
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.model.effect import Term
from rw_ekf.model.friction import GAUSS, Stribeck
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet
from tests.truth import run_of
from tools.measure.runs import OMEGA_S

STATIC = EffectSet(tuple(Term.of(CATALOGUE[name]) for name in ("quadratic_drag", "offset_torque", "motor_saturation")))


def run_along(course: Course, effects: EffectSet, state: Float64Array, *, with_jacobian: bool = False) -> FreeRun:
    """One run over the whole course."""
    first, last = np.array([0]), np.array([course.samples - 1])
    stribeck = Stribeck(OMEGA_S, GAUSS)
    return free_run(course, effects, stribeck, state[None, :], first, last, keep_path=True, with_jacobian=with_jacobian)


def test_the_sensitivity_is_the_derivative_with_static_effects_too() -> None:
    """Along P2, by first speed, parameters and three coefficients: central differences of whole runs."""
    course = run_of("P2", 2).course.window(0, 1500)
    state = np.array([20.0, *CK13_STATISTICAL, 2e-6, 0.02, 0.1])
    jacobian = run_along(course, STATIC, state, with_jacobian=True).jacobian
    for j, h in enumerate((1e-4, 1e-4, 1e-7, 1e-5, 1e-5, 1e-10, 1e-6, 1e-5)):
        step = h * np.eye(state.size)[j]
        ends = [run_along(course, STATIC, state + way * step).path_rad_s for way in (1.0, -1.0)]
        wanted = (ends[0] - ends[1]) / (2.0 * h)
        apart = np.abs(jacobian[:, j] - wanted)
        assert np.quantile(apart, 0.95) < 2e-3 * np.max(np.abs(wanted)), j


def test_effects_that_are_nothing_change_nothing() -> None:
    """With three coefficients of zero a run is that of the five states alone, its end and its sensitivity as well."""
    course = run_of("P1", 1).course
    bare = run_along(course, NO_EFFECTS, np.array([5.0, *CK13_STATISTICAL]), with_jacobian=True)
    idle = run_along(course, STATIC, np.array([5.0, *CK13_STATISTICAL, 0.0, 0.0, 0.0]), with_jacobian=True)
    assert np.array_equal(bare.path_rad_s, idle.path_rad_s)
    assert np.array_equal(bare.jacobian, idle.jacobian[:, :5])
    assert bare.ends_rad_s == pytest.approx([bare.path_rad_s[-1]], abs=0.0)
