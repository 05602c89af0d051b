"""A plan: the course of every wheel from each set of rates, as a JSON document and as tables for people."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rw_ekf.flyby.avoidance import Family, Interval, allowed_values, null_family, scaled_family
from rw_ekf.flyby.geometry import Flyby
from rw_ekf.flyby.wheel_rates import WheelCourse, WheelRate, course_of, wheel_rates
from rw_ekf.numbers import MISSING, number_text
from rw_ekf.units import rad_s_from_rpm, rpm_from_rad_s

SCHEMA = "rw_ekf.flyby/1"
TABLE_A1_RPM = (
    (300.0, 600.0, 900.0),
    (300.0, 600.0, -900.0),
    (300.0, -600.0, 900.0),
    (300.0, -600.0, -900.0),
    (-300.0, 600.0, -900.0),
    (-300.0, 600.0, 900.0),
    (-300.0, -600.0, -900.0),
    (-300.0, -600.0, 900.0),
)  # initial rates of [L17] table A1, in its order
_HEADER = (
    f"  {'wheel':<10}{'start':>9}{'end':>9}   {'criterion':<10}{'crossing s':>11}{'from closest':>14}{'rpm/s':>9}"
    f"{'slowest':>10}"
)


@dataclass(frozen=True)
class Case:
    """One set of rates at the start."""

    rates_rpm: tuple[float, ...]
    rates: tuple[WheelRate, ...]
    courses: tuple[WheelCourse, ...]


def case_of(flyby: Flyby, rates_rpm: Sequence[float]) -> Case:
    """Follow all wheels from their rates (n,) at the start."""
    rates = wheel_rates(flyby, [rad_s_from_rpm(rate) for rate in rates_rpm])
    return Case(tuple(rates_rpm), rates, tuple(course_of(flyby, rate) for rate in rates))


def plan_document(flyby: Flyby, cases: Sequence[Case], avoid_s: float | None = None) -> dict[str, Any]:
    """Return the document of `flyby --json` (docs/contract.md#documents).

    avoid_s: the time around closest approach to be kept free; None: not requested.
    """
    return {
        "schema": SCHEMA,
        "wheels": list(flyby.wheels.names),
        "closest_approach_s": flyby.closest_approach_s,
        "window_s": [0.0, flyby.duration_s],
        "cases": [
            {
                "rates_rpm": list(case.rates_rpm),
                "crossings_s": [[c.time_s for c in course.crossings] for course in case.courses],
                "crossing_rates_rpm_s": [
                    [rpm_from_rad_s(c.rate_rad_s2) for c in course.crossings] for course in case.courses
                ],
                "touches_s": [list(course.touches_s) for course in case.courses],
                "end_rates_rpm": [rpm_from_rad_s(course.end_rad_s) for course in case.courses],
                "slowest_rpm": [rpm_from_rad_s(course.slowest_rad_s) for course in case.courses],
                **({} if avoid_s is None else {"avoid": _avoid_document(flyby, case, avoid_s)}),
            }
            for case in cases
        ],
    }


def plan_text(flyby: Flyby, cases: Sequence[Case], avoid_s: float | None = None) -> str:
    """Return the same for a person."""
    axis = ", ".join(f"{value:g}" for value in flyby.slew_axis)
    angle = math.degrees(flyby.end_rad - flyby.start_rad)
    lines = [
        f"closest approach at {flyby.closest_approach_s:.1f} s, {flyby.miss_distance_m / 1e3:.6g} km from the centre; "
        f"window 0 to {flyby.duration_s:.1f} s, a slew of {angle:.4g} deg about ({axis}), "
        f"at most {math.degrees(flyby.peak_rate_rad_s):.3g} deg/s",
        "rates in rpm; the criterion sees a crossing where the rate at the end has the other sign",
    ]
    if len(flyby.wheels) > 3:
        lines.append(
            "more than three wheels: the pseudo-inverse shares the torque, their null-space part stays as it is"
        )
    for case in cases:
        lines += ["", f"[{', '.join(f'{rate:g}' for rate in case.rates_rpm)}] rpm", _HEADER]
        for name, course in zip(flyby.wheels.names, case.courses, strict=True):
            lines += _wheel_lines(flyby, name, course)
        if avoid_s is not None:
            lines += _avoid_text(flyby, case, avoid_s)
    return "\n".join(lines)


def _wheel_lines(flyby: Flyby, name: str, course: WheelCourse) -> list[str]:
    """One line for a wheel, and one more for each further crossing or touch."""
    start, end = rpm_from_rad_s(course.start_rad_s), rpm_from_rad_s(course.end_rad_s)
    slowest = number_text(rpm_from_rad_s(course.slowest_rad_s))
    happens = [(c.time_s, f"{rpm_from_rad_s(c.rate_rad_s2):+.2f}") for c in course.crossings]
    happens += [(time_s, "touches") for time_s in course.touches_s]
    rows = [
        f"{time_s:>11.1f}{time_s - flyby.closest_approach_s:>+14.1f}{how:>9}" for time_s, how in sorted(happens)
    ] or [f"{'none':>11}{MISSING:>14}{MISSING:>9}"]
    stated = "crossing" if course.ends_reversed else MISSING
    first = f"  {name:<10}{start:>9.1f}{end:>9.1f}   {stated:<10}{rows[0]}{slowest:>10}"
    return [first, *(" " * 43 + row for row in rows[1:])]


def _avoid_document(flyby: Flyby, case: Case, within_s: float) -> list[dict[str, Any]]:
    """For each family of rates the values that keep every wheel from zero near closest approach."""
    return [
        {"family": family.name, "unit": family.unit.strip() or None, "present": family.present,
         "allowed": [list(interval) for interval in allowed_values(flyby, family, within_s)]}
        for family in _families(flyby, case)
    ]  # fmt: skip


def _avoid_text(flyby: Flyby, case: Case, within_s: float) -> list[str]:
    """Return the same for a person."""
    lines = [f"  no wheel at zero within {within_s:g} s of closest approach:"]
    for family in _families(flyby, case):
        allowed = allowed_values(flyby, family, within_s)
        stated = " or ".join(_interval_text(interval, family.unit) for interval in allowed) or "for no value"
        lines.append(f"    {family.name} {stated} ({_nearest_text(family, allowed)})")
    return lines


def _families(flyby: Flyby, case: Case) -> list[Family]:
    rates = [rad_s_from_rpm(rate) for rate in case.rates_rpm]
    null = null_family(flyby, rates)
    return [scaled_family(flyby, rates), *([] if null is None else [null])]


def _interval_text(interval: Interval, unit: str) -> str:
    low, high = interval
    if math.isinf(low) and math.isinf(high):
        return "any value"
    if math.isinf(low):
        return f"below {number_text(high, 4)}{unit}"
    if math.isinf(high):
        return f"above {number_text(low, 4)}{unit}"
    return f"{number_text(low, 4)} to {number_text(high, 4)}{unit}"


def _nearest_text(family: Family, allowed: Sequence[Interval]) -> str:
    """Whether the rates that were requested do, and the least change that would."""
    now = family.present
    if any(low < now < high for low, high in allowed):
        return f"holds at {now:g}"
    bounds = [bound for interval in allowed for bound in interval if math.isfinite(bound)]
    if not bounds:
        return "nothing along this line helps"
    return f"fails at {now:g}, nearest {number_text(min(bounds, key=lambda bound: abs(bound - now)), 4)}{family.unit}"
