"""The page of a fleet: a line for each wheel, the worst first; the population; and the worst wheels over time."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.report.template_engine import rendered
from rw_ekf.fleet.siblings import Siblings
from rw_ekf.fleet.trend_document import Trends
from rw_ekf.fleet.trend_findings import UNLIKE, level_day
from rw_ekf.fleet.wheel_trends import ParameterTrend, WheelTrend
from rw_ekf.model.state import PARAMETER_NAMES, STATE_UNITS
from rw_ekf.numbers import number_text, plus_minus

TEMPLATES = Path(__file__).parent / "templates"
_COURSES = 50  # wheels that are drawn large: some 6 kB each
_SPARK, _COURSE, _STRIP = (100.0, 24.0), (400.0, 120.0), 1000.0  # sizes of the drawings, in their own units
_EDGE = 0.08  # of a drawing's height and width, that nothing is drawn in


def page_of(trends: Trends) -> str:
    """The page, in one file that needs no other."""
    wheels = trends.worst_first
    reported = [
        _wheel(wheel, trends.sentence_about(wheel), with_courses=place < _COURSES) for place, wheel in enumerate(wheels)
    ]
    worth = sum(trends.is_worth_a_look(wheel) for wheel in wheels)
    values = {
        "title": f"A fleet of {len(wheels)} wheels",
        "folder": trends.folder,
        "first_day": min(wheel.days.day[0] for wheel in wheels),
        "last_day": max(wheel.days.day[-1] for wheel in wheels),
        "badge": "unexplained" if worth else "adequate",
        "verdict": f"{worth} to look at" if worth else "Nothing to look at",
        "statement": f"{len(wheels)} wheels, {worth} of them with something to look at.",
        "names": list(PARAMETER_NAMES),
        "wheels": reported,
        "population": _population(trends),
        "unlike": f"{UNLIKE:g}",
        "courses_shown": _COURSES,
        "courses_left_out": len(wheels) > _COURSES,
    }
    return rendered("fleet.html", values, TEMPLATES)


def _wheel(wheel: WheelTrend, findings: list[str], *, with_courses: bool) -> dict[str, Any]:
    days = wheel.days
    counts = days.counts
    return {
        "name": days.wheel,
        "anchor": "w-" + re.sub(r"[^\w-]", "-", days.wheel),
        "findings": findings,
        "sparks": [_spark(wheel.parameters.get(name)) for name in PARAMETER_NAMES],
        "logs": len(days),
        "failed": wheel.failed,
        "note": f"{days.day[0]} to {days.day[-1]}: {len(days)} logs, {counts.get('rejected', 0)} readings rejected, "
        f"{counts.get('resets', 0)} resets, {counts.get('spikes', 0)} spikes reported; the residual was not noise in "
        f"{int(np.count_nonzero(days.not_noise))}",
        "courses": [_course(wheel, trend) for trend in wheel.parameters.values()] if with_courses else [],
    }


def _spark(trend: ParameterTrend | None) -> dict[str, str] | None:
    if trend is None:
        return None
    seen, line = _seen(trend), trend.fit.line
    draw = _Drawing(trend.course.points.time_y, np.concatenate((seen, line)), _SPARK)
    rate = plus_minus(*(100.0 * v for v in trend.relative_rate)).replace("+-", "±")
    return {"seen": draw.path(seen), "line": draw.path(line), "rate": f"{rate} %"}


def _course(wheel: WheelTrend, trend: ParameterTrend) -> dict[str, Any]:
    fit, points = trend.fit, trend.course.points
    seen = _seen(trend)
    error = np.sqrt(points.variance + fit.scatter**2 * points.share)
    draw = _Drawing(points.time_y, np.concatenate((seen - error, seen + error, fit.line)), _COURSE)
    days = wheel.days.day
    warm = "" if fit.per_K is None else f", {number_text(100.0 * fit.per_K / abs(fit.began))} % per K taken out"
    left = trend.remaining
    soon = "" if left is None else f"; limit {left.limit:.4g} in {_years(left.years_05)} to {_years(left.years_95)}"
    return {
        "name": trend.parameter,
        "unit": STATE_UNITS[trend.parameter],
        "said": f"{plus_minus(fit.level, fit.level_std)} on {level_day(wheel, trend)}, "
        f"{plus_minus(*(100.0 * v for v in trend.relative_rate))} % a year{warm}{soon}",
        "bars": [
            (f"{x:.1f}", f"{draw.y(value - size):.1f}", f"{draw.y(value + size):.1f}")
            for x, value, size in zip(draw.x, seen, error, strict=True)
        ],
        "seen": draw.path(seen),
        "line": draw.path(fit.line),
        "first_day": days[int(trend.course.known.rows[0])],
        "last_day": level_day(wheel, trend),
        "low": f"{draw.low:.4g}",
        "high": f"{draw.high:.4g}",
    }


def _seen(trend: ParameterTrend) -> Float64Array:
    """The points without what the temperature does."""
    points, per_K = trend.course.points, trend.fit.per_K
    return points.value if points.warmth_K is None or per_K is None else points.value - per_K * points.warmth_K


def _population(trends: Trends) -> list[dict[str, Any]]:
    strips = []
    for name, both in trends.found.population.items():
        fits = [wheel.parameters[name].fit for wheel in trends.found.wheels if name in wheel.parameters]
        size = abs(both["level"].mean)
        levels = np.array([fit.level for fit in fits])
        rates = np.array([100.0 * fit.rate / size for fit in fits])
        strips.append(_strip(f"{name} [{STATE_UNITS[name]}]", levels, both["level"]))
        strips.append(_strip(f"{name}, change [% a year]", rates, both["rate"]))
    return strips


def _strip(what: str, values: Sequence[float] | Float64Array, siblings: Siblings) -> dict[str, Any]:
    numbers = np.asarray(values)
    low, high = float(numbers.min()), float(numbers.max())
    across = (numbers - low) / ((high - low) or 1.0) * (1.0 - 2.0 * _EDGE) + _EDGE
    return {
        "what": what,
        "dots": [(f"{_STRIP * x:.1f}", p > UNLIKE) for x, p in zip(across, siblings.unlike, strict=True)],
        "low": f"{low:.4g}",
        "middle": f"median {np.median(numbers):.4g}",
        "high": f"{high:.4g}",
    }


def _years(years: float) -> str:
    return "never" if not np.isfinite(years) else f"{years:.2g} years"


class _Drawing:
    """Places of a course in a drawing of a size, time to the right and values upward."""

    def __init__(self, time_y: Float64Array, values: Float64Array, size: tuple[float, float]) -> None:
        self._width, self._height = size
        self.low, self.high = float(values.min()), float(values.max())
        self._span = (self.high - self.low) or 1.0
        self.x = self._width * (_EDGE / 2 + (1.0 - _EDGE) * time_y / (float(time_y[-1]) or 1.0))

    def y(self, value: float) -> float:
        """Downward, as drawings count."""
        return self._height * (1.0 - _EDGE - (1.0 - 2.0 * _EDGE) * (value - self.low) / self._span)

    def path(self, values: Float64Array) -> str:
        """Corners of a line through the values."""
        return " ".join(f"{x:.1f},{self.y(float(value)):.1f}" for x, value in zip(self.x, values, strict=True))
