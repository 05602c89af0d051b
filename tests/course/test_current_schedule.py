"""Which current was in force when: the rule over logs, the rule online, and a brute-force statement of it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.course.course import Course
from rw_ekf.course.current_schedule import CurrentSchedule

Row = tuple[float, float, float]  # time since the row before [s], current [A], delay [s]

rows = st.lists(
    st.tuples(
        st.floats(0.001, 0.3),
        st.floats(-0.5, 0.5),
        st.one_of(st.just(0.0), st.floats(0.0, 0.05), st.floats(0.0, 1.0)),
    ),
    min_size=2,
    max_size=30,
)


def columns(log: list[Row]) -> tuple[Float64Array, Float64Array, Float64Array]:
    step, current, delay = (np.array(v) for v in zip(*log, strict=True))
    return np.cumsum(step), current, delay


def in_force(t: float, time_s: Float64Array, current: Float64Array, delay: Float64Array) -> float:
    """The contract's rule as a sentence: the latest issued of those that act by now; before any, the first."""
    acting = np.flatnonzero(time_s + delay <= t)
    return float(current[acting[-1]]) if acting.size else float(current[0])


def course_of(
    time_s: Float64Array, current: Float64Array, delay: Float64Array, segment: Int64Array | None = None
) -> Course:
    return Course.of(time_s, np.zeros(time_s.size), current, delay, segment)


def interval_of(course: Course, i: int) -> tuple[Float64Array, Float64Array]:
    part = slice(int(course.piece_start[i]), int(course.piece_start[i + 1]))
    return course.pieces.duration_s[part], course.pieces.current_A[part]


@settings(max_examples=200, deadline=None)
@given(rows)
def test_every_moment_has_the_current_that_the_rule_says(log: list[Row]) -> None:
    """In the middle of every piece the current is the one a brute-force search finds, and pieces fill the intervals."""
    time_s, current, delay = columns(log)
    course = course_of(time_s, current, delay)
    for i, (begin, end) in enumerate(pairwise(time_s)):
        durations, currents = interval_of(course, i)
        assert course.pieces.begin_s[course.piece_start[i]] == begin
        assert durations.sum() == pytest.approx(end - begin, rel=1e-9)
        at = begin
        for duration, found in zip(durations, currents, strict=True):
            if duration > 1e-9:
                assert found == in_force(at + 0.5 * duration, time_s, current, delay)
            at += duration


@settings(max_examples=200, deadline=None)
@given(rows)
def test_online_and_whole_log_give_the_same_pieces(log: list[Row]) -> None:
    """Charge and duration of every interval agree between the schedule fed step by step and the one over the log."""
    time_s, current, delay = columns(log)
    course = course_of(time_s, current, delay)
    schedule = CurrentSchedule()
    for i, (begin, end) in enumerate(pairwise(time_s)):
        schedule.issue(begin, float(current[i]), float(delay[i]))
        durations, currents = (np.array(v) for v in schedule.pieces(begin, end))
        wanted_durations, wanted_currents = interval_of(course, i)
        assert durations.sum() == pytest.approx(wanted_durations.sum(), rel=1e-9)
        assert durations @ currents == pytest.approx(wanted_durations @ wanted_currents, abs=1e-12)


@settings(max_examples=100, deadline=None)
@given(rows)
def test_no_charge_is_lost_or_invented(log: list[Row]) -> None:
    """With delays below the period the charge of the log is the sum of each current times the time it was in force."""
    time_s, current, delay = columns(log)
    delay = np.minimum(delay, 0.9 * np.diff(time_s, append=time_s[-1] + 1.0))
    course = course_of(time_s, current, delay)
    begins = np.concatenate((time_s[:1], (time_s + delay)[1:-1], time_s[-1:]))
    expected = float(np.diff(np.minimum(begins, time_s[-1])) @ current[:-1]) if time_s.size > 1 else 0.0
    last = int(course.piece_start[-1])
    total = float(course.pieces.duration_s[:last] @ course.pieces.current_A[:last])
    assert total == pytest.approx(expected, abs=1e-10)


def test_a_delay_longer_than_the_period_takes_force_intervals_later() -> None:
    """A command 0.25 s late on a 0.1 s grid acts in the third interval, half of it."""
    time_s = np.array([0.0, 0.1, 0.2, 0.3])
    course = course_of(time_s, np.array([1.0, 2.0, 3.0, 4.0]), np.array([0.0, 0.25, 0.25, 0.25]))
    means = []
    for i in range(3):
        durations, currents = interval_of(course, i)
        means.append(float(durations @ currents / durations.sum()))
    assert means == pytest.approx([1.0, 1.0, 1.0])
    longer = np.append(time_s, 0.4)
    course = course_of(longer, np.arange(1.0, 6.0), np.array([0.0, 0.25, 0.25, 0.25, 0.25]))
    durations, currents = interval_of(course, 3)
    assert currents.tolist() == [1.0, 2.0]
    assert durations == pytest.approx([0.05, 0.05])


def test_no_piece_reaches_into_another_segment() -> None:
    """The interval that ends in a new segment has no duration, and the new one starts with its own first current."""
    time_s = np.array([0.0, 0.1, 0.2, 0.0, 0.1])
    segment = np.array([0, 0, 0, 1, 1])
    for delay in (0.0, 0.05):
        course = course_of(time_s, np.array([1.0, 2.0, 3.0, 4.0, 5.0]), np.full(5, delay), segment)
        durations, _ = interval_of(course, 2)
        assert durations.sum() == 0.0
        durations, currents = interval_of(course, 3)
        assert durations @ currents == pytest.approx(0.1 * 4.0)


def test_a_row_that_runs_backward_does_not_stretch_time() -> None:
    """From the last good row to the next one passes just the time between those two, with or without delays."""
    time_s = np.array([0.0, 0.1, 0.2, 0.05, 0.3])
    for delay in (0.0, 0.02):
        course = course_of(time_s, np.ones(5), np.full(5, delay))
        between = slice(int(course.piece_start[2]), int(course.piece_start[4]))
        assert course.pieces.duration_s[between].sum() == pytest.approx(0.1)
        assert np.all(np.diff(course.pieces.begin_s) >= 0.0)


def test_an_empty_log_has_no_pieces() -> None:
    """Nothing in, nothing out."""
    empty = np.zeros(0)
    assert course_of(empty, empty, empty).pieces.duration_s.size == 0
