"""The wheel's clock against the host's."""

from __future__ import annotations

import pytest

from drivers.wheel_clock import WheelClock


@pytest.mark.parametrize("factor", [1.0, 10.0])
def test_the_rate_of_the_wheels_clock_is_measured(factor: float) -> None:
    """A wheel whose time runs `factor` times as fast is found out within a second, to 1 %."""
    clock = WheelClock()
    for tick in range(11):
        host_s = 5.0 + 0.1 * tick
        clock.time_s(round(factor * 0.1 * tick, 3), host_s, None)
    assert clock.rate == pytest.approx(factor, rel=0.01)


def test_a_restart_begins_the_comparison_of_clocks_anew() -> None:
    """Time before the wheel restarted does not count towards the rate after it."""
    clock = WheelClock()
    for uptime_s, host_s in [(100.0, 0.0), (101.0, 1.0), (0.5, 10.0), (1.5, 11.0)]:
        clock.time_s(uptime_s, host_s, None)
    assert clock.segment == 1
    assert clock.rate == pytest.approx(1.0)


@pytest.mark.parametrize("flag_first", [True, False])
def test_a_restart_told_twice_is_one_segment(flag_first: bool) -> None:
    """Uptime running backward and the status flag speak of one restart, in either order; the next one counts anew."""
    clock = WheelClock()
    clock.time_s(100.0, 0.0, None)
    if flag_first:
        clock.note_restart()
    clock.time_s(0.2, 1.0, None)
    if not flag_first:
        clock.note_restart()
    clock.time_s(0.3, 1.1, None)
    assert clock.segment == 1
    clock.time_s(0.1, 2.0, None)
    assert clock.segment == 2
