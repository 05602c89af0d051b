"""The drag that is read is the one that acted, whatever is missing."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rw_ekf.control.compensation.drag_reading import DragReading
from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.records import Innovation, Tick, WheelSample
from tests.control.compensation.bare_wheel import BELIEVED, STRIBECK
from tests.ticks import tick_of

GAIN, DRAG = 15.0, 0.6
KNOWN = WheelKnown.of_parameters(0.0, BELIEVED, STRIBECK)  # another speed than is read


def sample(time_s: float, speed_rad_s: float | None, current_A: float, segment: int = 0) -> WheelSample:
    """A reading with the current that was in force before it."""
    return WheelSample(time_s, speed_rad_s, current_command_A=current_A, segment=segment)


def test_over_missing_readings_the_drag_is_the_mean_of_all_that_acted() -> None:
    """Three intervals under different currents, two readings lost: the mean drag is exact."""
    reading, speed, time_s = DragReading(GAIN, "raw"), 5.0, 0.0
    assert reading.step(tick_of(sample(0.0, speed, 0.0)), KNOWN) is None
    for dt_s, current_A, lost in ((0.1, 0.02, True), (0.3, -0.05, True), (0.05, 0.1, False)):
        time_s += dt_s
        speed += dt_s * (GAIN * current_A - DRAG)
        found = reading.step(tick_of(sample(time_s, None if lost else speed, current_A)), KNOWN)
    assert found == pytest.approx((0.45, DRAG), rel=1e-12)


@pytest.mark.parametrize(("time_s", "segment"), [(30.0, 0), (0.1, 1)])
def test_a_gap_and_a_new_segment_say_nothing_of_the_drag(time_s: float, segment: int) -> None:
    """The reading after it begins anew, the one behind that is read as ever."""
    reading = DragReading(GAIN, "raw")
    reading.step(tick_of(sample(0.0, 5.0, 0.0)), KNOWN)
    assert reading.step(tick_of(sample(time_s, -80.0, 0.1, segment)), KNOWN) is None
    after = tick_of(sample(time_s + 0.1, -80.0 + 0.1 * (1.5 - DRAG), 0.1, segment))
    assert reading.step(after, KNOWN) == pytest.approx((0.1, DRAG), rel=1e-9)


def test_a_reading_far_from_where_it_is_expected_is_left_out_where_it_is_alone() -> None:
    """Twenty sigma off: once, it is as if it were missing; twice in a row, that is how it is."""

    def tick(time_s: float, speed_rad_s: float, off_sigmas: float) -> Tick:
        turn = tick_of(sample(time_s, speed_rad_s, 0.0))
        innovation = Innovation(time_s, 0.1 * off_sigmas, 0.1, off_sigmas**2, 9.0, False)
        return replace(turn, estimate=replace(turn.estimate, innovation=innovation))

    reading = DragReading(GAIN, "raw")
    reading.step(tick(0.0, 5.0, 0.0), KNOWN)
    assert reading.step(tick(0.1, 25.0, 20.0), KNOWN) is None
    assert reading.step(tick(0.2, 5.0 - 0.2 * DRAG, 0.0), KNOWN) == pytest.approx((0.2, DRAG), rel=1e-9)
    assert reading.step(tick(0.3, 3.0, 20.0), KNOWN) is None
    assert reading.step(tick(0.4, 3.0, 20.0), KNOWN) is not None
    assert reading.step(tick(0.5, 3.0 - 0.1 * DRAG, 9.0), KNOWN) == pytest.approx((0.1, DRAG), rel=1e-9)
