"""[L17] Appendix A as printed: table A1, the matrix of (A5), the criteria C1, C2 and C4."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rw_ekf.flyby.flyby_plan import TABLE_A1_RPM, case_of
from rw_ekf.flyby.settings import read_flyby
from rw_ekf.flyby.wheel_rates import wheel_rates
from rw_ekf.units import rpm_from_rad_s

NO_CROSSING = None
TABLE_A1_S = (
    (800, NO_CROSSING, 1200),
    (500, 1000, NO_CROSSING),
    (NO_CROSSING, 750, 1800),
    (NO_CROSSING, NO_CROSSING, 1250),
    (NO_CROSSING, 900, 1700),
    (NO_CROSSING, NO_CROSSING, 1560),
    (1500, NO_CROSSING, 1000),
    (1200, 780, NO_CROSSING),
)
ROOT8 = math.sqrt(8.0)


@pytest.mark.parametrize(("rates_rpm", "printed"), list(zip(TABLE_A1_RPM, TABLE_A1_S, strict=True)))
def test_every_entry_of_table_a1(rates_rpm: tuple[float, ...], printed: tuple[float | None, ...]) -> None:
    """24 of 24: each crossing within 40 s of the printed time, and none where the paper says none."""
    for course, time_s in zip(case_of(read_flyby(), rates_rpm).courses, printed, strict=True):
        assert course.touches_s == ()
        if time_s is NO_CROSSING:
            assert course.crossings == ()
        else:
            (crossing,) = course.crossings
            assert crossing.time_s == pytest.approx(time_s, abs=40.0)


@pytest.mark.parametrize("rates_rpm", TABLE_A1_RPM)
def test_the_criteria_are_the_rates_at_the_end(rates_rpm: tuple[float, ...]) -> None:
    """C1, C2 and C4 as printed, and that their signs predict the crossings of table A1."""
    one, two, four = rates_rpm
    c1 = one / 2.0 - (0.5 + 1.0 / ROOT8) * two - (0.5 - 1.0 / ROOT8) * four
    c2 = (-0.5 + 1.0 / ROOT8) * one - two / 4.0 + (0.25 + math.sqrt(0.5)) * four
    c4 = -(0.5 + 1.0 / ROOT8) * one + (0.25 - math.sqrt(0.5)) * two - four / 4.0
    for course, criterion in zip(case_of(read_flyby(), rates_rpm).courses, (c1, c2, c4), strict=True):
        assert rpm_from_rad_s(course.end_rad_s) == pytest.approx(criterion, abs=1e-9)
        assert course.ends_reversed == (len(course.crossings) == 1)


def test_the_printed_matrix_of_a5_is_the_closed_form() -> None:
    """Rates from (A5), matrix and first term as printed, agree at any angle: so P(2,1) is sqrt(2/3)."""
    flyby = read_flyby()
    assert flyby.wheels.axes[1, 0] == pytest.approx(math.sqrt(2.0 / 3.0), rel=1e-12)
    start = np.array([31.0, -17.0, 52.0])
    rates = wheel_rates(flyby, start.tolist())
    for angle in np.linspace(flyby.start_rad, flyby.end_rad, 7):
        beta, root6 = angle - flyby.start_rad, math.sqrt(6.0)
        c, s = math.cos(beta), math.sin(beta)
        one, two = s / root6 + (c - 1.0) / 3.0, 2.0 * s / root6 + (1.0 - c) / 6.0
        matrix = np.array([
            [(2.0 + c) / 3.0, -s / root6 + (c - 1.0) / 3.0, one],
            [one, (1.0 + 5.0 * c) / 6.0, two],
            [-s / root6 + (c - 1.0) / 3.0, -2.0 * s / root6 + (1.0 - c) / 6.0, (1.0 + 5.0 * c) / 6.0],
        ])  # fmt: skip
        slew = 5300.0 / 0.16 * (flyby.rate_rad_s(flyby.start_rad) - flyby.rate_rad_s(float(angle)))
        printed = slew * np.array([math.sqrt(2.0 / 3.0), -1.0 / root6, -1.0 / root6]) + matrix @ start
        np.testing.assert_allclose([rate(float(angle)) for rate in rates], printed, rtol=0.0, atol=1e-9)


def test_wheels_that_start_at_rest_cross_nothing() -> None:
    """[0, 0, 0] rpm, the only case of [L17] without a crossing: at zero at both ends of the window alone."""
    flyby = read_flyby()
    for course in case_of(flyby, (0.0, 0.0, 0.0)).courses:
        assert course.crossings == ()
        assert course.touches_s == pytest.approx((0.0, flyby.duration_s))


def test_a_flyby_backward_in_time_is_the_same_with_two_wheels_swapped() -> None:
    """The symmetry of this geometry: from where a case ended, RWA-2 and RWA-4 swapped, its mirror image follows.

    Reversing time turns all rates and the slew about; the mirror x -> -x turns the slew back, and takes RWA-1 to itself
    and RWA-2 to RWA-4, all reversed once more. Reversing the rates alone is no symmetry: the slew has a sense.
    """
    flyby = read_flyby()
    for rates_rpm in TABLE_A1_RPM:
        one, two, four = case_of(flyby, rates_rpm).courses
        end_rpm = [rpm_from_rad_s(course.end_rad_s) for course in (one, four, two)]
        for course, again in zip((one, four, two), case_of(flyby, end_rpm).courses, strict=True):
            assert rpm_from_rad_s(again.end_rad_s) == pytest.approx(rpm_from_rad_s(course.start_rad_s), abs=1e-9)
            mirrored = sorted((flyby.duration_s - c.time_s, -c.rate_rad_s2) for c in course.crossings)
            found = [value for c in again.crossings for value in (c.time_s, c.rate_rad_s2)]
            assert found == pytest.approx([value for pair in mirrored for value in pair], abs=1e-6)
    reversed_times = [c.time_s for course in case_of(flyby, (-300.0, -600.0, -900.0)).courses for c in course.crossings]
    times = [c.time_s for course in case_of(flyby, (300.0, 600.0, 900.0)).courses for c in course.crossings]
    assert min(abs(a - b) for a in times for b in reversed_times) > 100.0
