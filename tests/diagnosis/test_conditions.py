"""What surrounds the speed in a log: the period of its current."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rw_ekf.course.conditions import command_frequency
from rw_ekf.effects.catalogue import CATALOGUE
from tests.diagnosis.simulated import record_of, simulated
from tests.effects.test_catalogue import WHEEL


@pytest.mark.parametrize(("profile", "expected_Hz"), [("S1", 1 / 480), ("S2", 1 / 120), ("S3", 1 / 30), ("S5", 1 / 30)])
def test_a_current_that_repeats_itself_has_a_frequency(profile: str, expected_Hz: float) -> None:
    """A sine three times over is known to within the record's own resolution."""
    run = simulated(profile=profile, seed=3)
    found = command_frequency(record_of(run).course)
    assert found == pytest.approx(expected_Hz, abs=0.2 / float(run.time_s[-1]))


@pytest.mark.parametrize("profile", ["identification", "P1", "P2"])
def test_a_current_that_does_not_repeat_itself_has_none(profile: str) -> None:
    """Profiles of many steps are not periodic."""
    assert command_frequency(record_of(simulated(profile=profile, seed=3)).course) == 0.0


def test_harmonics_of_the_command_are_no_place_for_an_external_torque() -> None:
    """In a record that repeats itself all that depends on the speed is periodic: those frequencies prove nothing."""
    effect = CATALOGUE["external_torque"]
    periodic = effect.candidates(replace(WHEEL, command_Hz=0.01))
    everywhere = effect.candidates(WHEEL)
    width = 0.5 / WHEEL.duration_s  # half a line
    assert 0 < len(everywhere) - len(periodic) <= 8 * 5
    assert all(abs(c.shape[0] - 0.01 * m) > 0.99 * width for c in periodic for m in range(1, 9))
