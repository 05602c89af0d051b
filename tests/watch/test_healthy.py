"""A healthy wheel raises no alarm."""

from __future__ import annotations

import pytest

from rw_ekf.watch.wheel_watch import dependence_threshold, onset_threshold
from tests.counting import lines_of
from tools.measure.watch_runs import PROFILES, commands, drawn_wheel, filtered, heard, simulated, stream, watch_of


@pytest.mark.slow
@pytest.mark.parametrize("profile", PROFILES)
def test_hours_of_a_healthy_wheel_raise_nothing(profile: str) -> None:
    """Two hours of each profile, a drawn wheel each, 22 h together: not one alarm."""
    time_s, current_A = commands(profile, 2.0, 5)
    number = list(PROFILES).index(profile)
    assert heard(simulated(drawn_wheel(500 + number), time_s, current_A, 500 + number)) == []


@pytest.mark.parametrize("noise_rpm", [0.3, 5.0])
def test_neither_does_one_with_another_noise(noise_rpm: float) -> None:
    """The same with quiet and loud readings that the configuration knows of, twenty minutes of two profiles."""
    for profile in ("P1", "identification"):
        time_s, current_A = commands(profile, 0.33, 6)
        run = simulated(drawn_wheel(600, 0.3), time_s, current_A, 600, noise_rpm=noise_rpm)
        assert heard(run, noise_rpm) == []


def test_a_wheel_at_rest_raises_nothing() -> None:
    """No current at all for half an hour: there is nothing to learn, and nothing is claimed."""
    time_s, current_A = commands("steady", 0.5, 1)
    assert heard(simulated(drawn_wheel(601), time_s, 0.0 * current_A, 601)) == []


def test_thresholds_grow_with_rarer_alarms_and_faster_loops() -> None:
    """A tenth of the false alarms, or ten times the samples, needs a higher threshold; none is below 3 sigma."""
    assert onset_threshold(0.1, 0.1) > onset_threshold(1.0, 0.1) > 5.5
    assert onset_threshold(1.0, 0.01) > onset_threshold(1.0, 0.1)
    assert dependence_threshold(0.1, 10.0) > dependence_threshold(1.0, 10.0) > 5.0
    assert dependence_threshold(1.0e9, 10.0) == 3.0


def test_it_costs_next_to_nothing() -> None:
    """A step is a few hundred lines of Python, and no more of them late in a run than early: nothing piles up."""
    time_s, current_A = commands("P2", 0.2, 1)
    run = simulated(drawn_wheel(602), time_s, current_A, 602)
    constants, done = filtered(run)
    steps = list(stream(run, constants, done))
    watch = watch_of(constants)
    lines = [lines_of(lambda: watch.step(step)) for step in steps]  # noqa: B023
    third = len(lines) // 3
    assert sum(lines[-third:]) < 1.2 * sum(lines[third:-third])
    assert sum(lines) < 1000 * len(lines)  # twice what was counted
