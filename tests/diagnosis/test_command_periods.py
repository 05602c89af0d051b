"""A periodic torque at a period of the command's own may be an answer to it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.diagnosis.checks.command_periods import chance_of_answer

TIME_S = 0.1 * np.arange(6000, dtype=float)
SINES: Float64Array = 0.2 * np.sin(2.0 * np.pi * TIME_S / 48.0) + 0.1 * np.sin(2.0 * np.pi * TIME_S / 20.9)
STEPS: Float64Array = np.repeat(np.random.default_rng(4).uniform(-0.3, 0.3, 300), 20)


def chance(current_A: Float64Array, *periods_s: float) -> float:
    """Of a fit with torques of these periods."""
    terms = [SimpleNamespace(shape=(1.0 / period, 0.0, 0.0), settled=False) for period in periods_s]
    fit: Any = SimpleNamespace(model=SimpleNamespace(of=lambda name: terms))
    return chance_of_answer(fit, Course.of(TIME_S, np.zeros(TIME_S.size), current_A))


def test_a_torque_at_a_line_of_the_command_is_likelier_an_answer_to_it() -> None:
    """Two sines command, and a torque has the period of one: more likely than not; of both: nearly sure."""
    assert 0.6 < chance(SINES, 20.9) < 0.9
    assert chance(SINES, 20.9, 48.0) > 0.98


@pytest.mark.parametrize("period_s", [31.0, 7.3, 97.0, 20.6])
def test_a_torque_at_any_other_period_is_none(period_s: float) -> None:
    """A pump, a structure: nothing to do with the command."""
    assert chance(SINES, period_s) == 0.0


def test_a_command_without_lines_answers_nothing() -> None:
    """Random steps are all periods alike."""
    assert all(chance(STEPS, period) < 0.5 for period in (20.9, 31.0, 48.0, 7.3))
    assert chance(np.zeros(TIME_S.size), 20.9) == 0.0
