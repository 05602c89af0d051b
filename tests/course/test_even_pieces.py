"""Pieces of current that no speed could show apart are one: no charge is lost, and a free run goes where it went."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rw_ekf.course.course import Course
from rw_ekf.course.free_run import free_run
from rw_ekf.likelihood.one_step import state_vector
from tests.diagnosis.simulated import TRUTH, simulated

CURRENTS = st.lists(st.sampled_from([0.0, 0.1, 0.1, 0.3, -0.2]), min_size=2, max_size=30)


@given(CURRENTS, st.integers(0, 2**30 - 1), st.floats(0.0, 0.09), st.sampled_from([0.0, 1.0e-4, 3.0e-3, 1.0]))
def test_between_two_readings_the_charge_is_as_it_was(
    currents: list[float], ends: int, delay_s: float, least_A_s: float
) -> None:
    """Over several segments and late commands: an interval has its charge, and is inside off by `least` at most."""
    n = len(currents)
    segment = np.cumsum([int(ends >> i & 3 == 3) for i in range(n)])
    time_s = np.linspace(0.0, 0.1 * (n - 1), n)
    course = Course.of(time_s, np.zeros(n), np.array(currents), np.full(n, delay_s), segment)
    even = course.with_even_pieces(least_A_s)
    np.testing.assert_allclose(even.mean_current_A, course.mean_current_A, atol=1.0e-12)
    assert set(even.pieces.begin_s) <= set(course.pieces.begin_s)
    for i in range(n - 1):
        if segment[i] != segment[i + 1]:
            continue
        at = np.linspace(course.time_s[i], course.time_s[i + 1], 50)
        assert np.max(np.abs(_charge(even, i, at) - _charge(course, i, at))) <= least_A_s + 1.0e-12
        assert even.first_piece[i] <= even.piece_start[i]
    if least_A_s == 0.0:
        assert set(even.pieces.current_A) == set(course.pieces.current_A)
    if least_A_s == 1.0:
        assert even.pieces.current_A.size <= n


def test_a_free_run_goes_where_it_went() -> None:
    """With pieces a tenth of a reading's noise apart as one, it is off by a hundredth of that, ten minutes on."""
    run = simulated(seed=2, samples=6000)
    course = Course.of(run.time_s, run.measured_speed_rad_s, run.current_command_A, np.full(run.time_s.size, 0.01))
    noise = 0.105
    even = course.with_even_pieces(0.1 * noise / TRUTH.parameters.motor_gain)
    assert even.pieces.current_A.size < 0.6 * course.pieces.current_A.size
    state = state_vector(TRUTH.coefficients, TRUTH.effects)[None, :]
    ends = np.array([0]), np.array([course.samples - 1])
    there, here = (
        free_run(over, TRUTH.effects, TRUTH.stribeck, state, *ends, keep_path=True).path_rad_s
        for over in (course, even)
    )
    assert np.sqrt(np.mean((there - here) ** 2)) < 1.0e-2 * noise


def test_pieces_without_a_length_stay_as_they_are() -> None:
    """Rows of one time, and a record of one row, are nothing to divide by."""
    course = Course.of(np.array([0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 1.0, 2.0]))
    assert course.with_even_pieces(1.0).pieces.current_A.tolist() == [0.0, 1.0, 2.0]
    alone = Course.of(np.zeros(1), np.zeros(1), np.ones(1))
    assert alone.with_even_pieces(1.0).samples == 1


def _charge(course: Course, i: int, at_s: np.ndarray) -> np.ndarray:
    """Charge since sample i at times within its interval."""
    part = slice(course.piece_start[i], course.piece_start[i + 1])
    begin, lasts, current = (values[part] for values in course.pieces)
    return np.array([float(np.sum(current * np.clip(t - begin, 0.0, lasts))) for t in at_s])
