"""The dedicated experiments of the deterministic method, on a simulated wheel that performs them."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.course.course import Course
from rw_ekf.errors import FilterError
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.identify.deterministic import deterministic
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.units import RAD_S_PER_RPM
from tests.truth import run_of
from tools.measure.runs import OMEGA_S


def test_dedicated_stretches_give_gain_and_drag() -> None:
    """On the identification profile k, b and c come out within 4 of their own sigmas, k to 1 %."""
    run = run_of("identification", 1)
    found = deterministic(run.course, run.current_A, OMEGA_S, RAD_S_PER_RPM, DEFAULT_PRIOR)
    sigmas = (np.array(found.parameters) - np.array(CK13_STATISTICAL)) / np.array(found.std)
    assert np.max(np.abs(sigmas[:3])) < 4.0
    assert found.parameters.motor_gain == pytest.approx(CK13_STATISTICAL.motor_gain, rel=0.01)
    assert found.coast_down_s > 60.0
    assert found.break_aways > 0


def test_a_log_without_a_coast_down_is_refused_with_the_way_out() -> None:
    """Without a coast-down there is no b: FilterError names what is missing and the method that needs none."""
    run = run_of("P2", 1)
    with pytest.raises(FilterError, match="coast-down"):
        deterministic(run.course, run.current_A, OMEGA_S, RAD_S_PER_RPM, DEFAULT_PRIOR)


def test_a_bare_coast_down_gives_drag_and_leaves_the_rest_to_the_prior() -> None:
    """Speed decaying without any current: b and c within 5 sigma of the closed form's, k and T_s as before."""
    k, b, c, _ = CK13_STATISTICAL
    time_s = np.arange(0.0, 120.0, 0.1)
    speed = (150.0 + c / b) * np.exp(-b * time_s) - c / b
    noisy = speed + np.random.default_rng(5).normal(0.0, RAD_S_PER_RPM, time_s.size)
    current_A = np.zeros(time_s.size)
    found = deterministic(Course.of(time_s, noisy, current_A), current_A, OMEGA_S, RAD_S_PER_RPM, DEFAULT_PRIOR)
    assert abs(found.parameters.viscous - b) < 5.0 * found.std[1]
    assert abs(found.parameters.coulomb - c) < 5.0 * found.std[2]
    assert found.parameters.motor_gain == k
    assert found.std[0] == DEFAULT_PRIOR.std[1]
    assert found.break_aways == 0
    assert found.driven_s == 0.0
