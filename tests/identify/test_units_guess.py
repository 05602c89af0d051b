"""Wrong units: the factor that would make a wheel of the record is asked for, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.course.course import Course
from rw_ekf.identify.misread import misreadings_and_questions
from rw_ekf.identify.units_guess import question_of_units, times
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.starting_point import setup_of_record
from tests.truth import run_of


@pytest.mark.parametrize(
    ("speed", "current", "expected"),
    [
        (1.0, 1000.0, "is the current in mA?"),
        (30.0 / np.pi, 1.0, "is the speed in rpm"),
        (180.0 / np.pi, 1000.0, "degrees per second and is the current in mA?"),
    ],
)
def test_a_log_in_other_units_is_asked_about_them(speed: float, current: float, expected: str) -> None:
    """A whole record with a forgotten factor: the likely unit is named, and the note says how far off the gain is."""
    run = run_of("P2", 4)
    driven, read, no_delay = current * run.current_A, speed * run.reading_rad_s, np.zeros(run.time_s.size)
    log = WheelLog("a", run.time_s, read, driven, "current_A", no_delay, no_delay.astype(np.int64))
    found, (wanted,) = misreadings_and_questions(log)
    assert found == ()
    assert expected in wanted
    (stated,) = setup_of_record(Course.of(run.time_s, read, driven)).notes
    assert "of a wheel's" in stated or "times a wheel's" in stated


def test_a_machine_of_no_wheels_size_in_any_unit_is_not_asked() -> None:
    """A bare rotor with 180 times a wheel's Coulomb friction and 16 times its gain is just another machine."""
    rotor = CK13_STATISTICAL._replace(motor_gain=3.0, coulomb=2.0)
    assert question_of_units(rotor) is None
    assert question_of_units(CK13_STATISTICAL._replace(motor_gain=-15.0)) is None


def test_ratios_read_as_people_say_them() -> None:
    """No exponents, two digits."""
    assert [times(v) for v in (1.0, 2.43, 1.0 / 1160.0, 9.6e4)] == ["1 times", "2.4 times", "1/1200 of", "96000 times"]
