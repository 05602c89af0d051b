"""What the results of a fleet come to: each wheel's courses, the fleet beside it, and what of it is worth a look."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtr

from rw_ekf.fleet.course_fit import CourseFit, walks_of_fleet
from rw_ekf.fleet.daily import WheelDays
from rw_ekf.fleet.points import Course, course_of
from rw_ekf.fleet.remaining import Limit, Remaining, remaining
from rw_ekf.fleet.siblings import LEAST_WHEELS, Siblings, siblings_of
from rw_ekf.model.state import PARAMETER_NAMES

# An ageing worth a word: one per cent a year, of which twenty years make a fifth; chosen. Less is shown, not accused.
MATERIAL_PER_YEAR = 0.01
_FLOORS = {
    "level": 0.005,
    "rate": 0.002,
}  # of the population's level: spreads below which no difference matters; chosen


@dataclass(frozen=True)
class ParameterTrend:
    """One parameter of one wheel."""

    parameter: str
    course: Course
    remaining: Remaining | None = None
    level_unlike: float | None = None  # None: too few siblings
    rate_unlike: float | None = None
    shrunk: tuple[float, float] | None = None  # level drawn towards the siblings', and its standard deviation

    @property
    def fit(self) -> CourseFit:
        """The numbers."""
        return self.course.fit

    @property
    def relative_rate(self) -> tuple[float, float]:
        """Rate and its standard deviation, of where the line begins, per year."""
        size = abs(self.fit.began)
        return self.fit.rate / size, self.fit.rate_std / size

    @property
    def ages(self) -> float:
        """Probability that it changes by more than is immaterial, to one side."""
        rate, std = self.relative_rate
        std = max(std, 1e-12)
        return float(max(ndtr((rate - MATERIAL_PER_YEAR) / std), ndtr((-rate - MATERIAL_PER_YEAR) / std)))


@dataclass
class WheelTrend:
    """One wheel."""

    days: WheelDays
    parameters: dict[str, ParameterTrend] = field(default_factory=dict)

    @property
    def failed(self) -> int:
        """Logs without a result."""
        return int(np.count_nonzero(~self.days.ok))


@dataclass(frozen=True)
class FleetTrends:
    """All wheels, and what the fleet is like: by parameter and `level` or `rate`."""

    wheels: list[WheelTrend]
    population: dict[str, dict[str, Siblings]]
    reference_degC: float | None


def trends_of(wheels: Sequence[WheelDays], limits: Mapping[str, Limit]) -> FleetTrends:
    """The trends of a fleet, from the days of its wheels."""
    known = [days.temperature_degC[np.isfinite(days.temperature_degC)] for days in wheels]
    warm = np.concatenate(known) if known else np.zeros(0)
    reference = float(np.median(warm)) if warm.size else None
    found = [WheelTrend(days) for days in wheels]
    for name in PARAMETER_NAMES:
        for wheel, course in zip(found, _courses(wheels, name, reference), strict=True):
            if course is not None:
                limit = limits.get(name)
                left = None if limit is None else remaining(course.fit, limit.of(course.fit.began))
                wheel.parameters[name] = ParameterTrend(name, course, left)
    population = {name: _compared(found, name) for name in PARAMETER_NAMES}
    return FleetTrends(found, {name: both for name, both in population.items() if both}, reference)


def _courses(wheels: Sequence[WheelDays], name: str, reference_degC: float | None) -> list[Course | None]:
    """Each wheel's course of a parameter; where there are siblings, by what all of them say of how they wander."""
    alone = [course_of(days, name, reference_degC) for days in wheels]
    walks = [course.fit.walks for course in alone if course is not None]
    if len(walks) < LEAST_WHEELS:
        return alone
    of_all = walks_of_fleet(np.array(walks))
    return [
        None if course is None else course_of(days, name, reference_degC, of_all)
        for days, course in zip(wheels, alone, strict=True)
    ]


def _compared(wheels: Sequence[WheelTrend], name: str) -> dict[str, Siblings]:
    """Levels and rates of a parameter side by side; what comes of it is put into the wheels' trends."""
    having = [wheel for wheel in wheels if name in wheel.parameters]
    fits = [wheel.parameters[name].fit for wheel in having]
    if not fits:
        return {}
    size = float(np.median([abs(fit.level) for fit in fits]))
    levels = siblings_of(
        np.array([fit.level for fit in fits]), np.array([fit.level_std for fit in fits]), _FLOORS["level"] * size
    )
    rates = siblings_of(
        np.array([fit.rate for fit in fits]), np.array([fit.rate_std for fit in fits]), _FLOORS["rate"] * size
    )
    if levels is None or rates is None:
        return {}
    for place, wheel in enumerate(having):
        wheel.parameters[name] = replace(
            wheel.parameters[name],
            level_unlike=float(levels.unlike[place]),
            rate_unlike=float(rates.unlike[place]),
            shrunk=(float(levels.shrunk[place]), float(levels.shrunk_std[place])),
        )
    return {"level": levels, "rate": rates}
