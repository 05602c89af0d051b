"""The document of `fleet trends`, and its text: numbers with bands, findings as sentences, the worst wheel first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rw_ekf.console import printable
from rw_ekf.fleet.diagnoses import WindowFinding
from rw_ekf.fleet.points import LEAST_POINTS
from rw_ekf.fleet.remaining import Limit
from rw_ekf.fleet.siblings import LEAST_WHEELS
from rw_ekf.fleet.trend_findings import concern_of, days_about, finding_kinds, level_day, sentences
from rw_ekf.fleet.wheel_trends import FleetTrends, ParameterTrend, WheelTrend
from rw_ekf.model.state import STATE_UNITS
from rw_ekf.numbers import plus_minus
from rw_ekf.result_display import Shown

SCHEMA = "rw_ekf.fleet_trends/1"
_BAND = 1.959963984540054  # sigmas of 95 %
_SHOWN_WHEELS = 20
_NAMED = 5  # wheels in one sentence


@dataclass(eq=False, frozen=True)
class Trends(Shown):
    """The trends of a fleet."""

    folder: str
    found: FleetTrends
    limits: Mapping[str, Limit]
    diagnosed: Mapping[str, list[WindowFinding]] = field(default_factory=dict)  # by wheel

    def document(self) -> dict[str, Any]:
        """The document of `fleet trends --json`."""
        return {
            "schema": SCHEMA,
            "folder": self.folder,
            "reference_degC": self.found.reference_degC,
            "limits": [
                {"parameter": name, "value": limit.value, "share": limit.share} for name, limit in self.limits.items()
            ],
            "population": [
                {
                    "parameter": name,
                    "unit": STATE_UNITS[name],
                    "wheels": int(both["level"].shrunk.size),
                    "level": both["level"].mean,
                    "level_spread": both["level"].spread,
                    "rate_per_year": both["rate"].mean,
                    "rate_std_per_year": both["rate"].mean_std,
                    "rate_spread_per_year": both["rate"].spread,
                }
                for name, both in self.found.population.items()
            ],
            "wheels": [
                {**_wheel(wheel), "diagnoses": [window.document() for window in self.diagnosed_of(wheel)]}
                for wheel in self.worst_first
            ],
        }

    def diagnosed_of(self, wheel: WheelTrend) -> list[WindowFinding]:
        """The windows of a wheel that were diagnosed."""
        return self.diagnosed.get(wheel.days.wheel, [])

    def is_worth_a_look(self, wheel: WheelTrend) -> bool:
        """Whether something is found of it, or a diagnosis says that the model lacks something."""
        return bool(finding_kinds(wheel)) or any(window.kind != "adequate" for window in self.diagnosed_of(wheel))

    def sentence_about(self, wheel: WheelTrend) -> list[str]:
        """Its findings and what was diagnosed, as sentences."""
        return [*sentences(wheel), *(f"diagnosed, {window.text}" for window in self.diagnosed_of(wheel))]

    @property
    def worst_first(self) -> list[WheelTrend]:
        """Wheels worth a look before the others, the surest first; of equals the faster change."""
        return sorted(self.found.wheels, key=lambda wheel: (not self.is_worth_a_look(wheel), *_order(wheel)))

    def text(self) -> str:
        """What `fleet trends` prints."""
        wheels = self.worst_first
        worth = [wheel for wheel in wheels if self.is_worth_a_look(wheel)]
        lines = [f"{self.folder}: {len(wheels)} wheels, {len(worth)} with something to look at"]
        for wheel in worth[:_SHOWN_WHEELS]:
            lines += [printable(f"  {wheel.days.wheel}: {text}") for text in self.sentence_about(wheel)]
        if len(worth) > _SHOWN_WHEELS:
            lines.append(f"  and {len(worth) - _SHOWN_WHEELS} wheels more: --json has them all")
        for name, both in self.found.population.items():
            level, rate = both["level"], both["rate"]
            share = 100.0 / abs(level.mean)
            lines.append(
                f"  all: {name} {plus_minus(level.mean, level.spread)} {STATE_UNITS[name]} (spread), "
                f"{plus_minus(share * rate.mean, share * rate.mean_std)} % a year (spread {share * rate.spread:.2g})"
            )
        return "\n".join([*lines, *(f"  {text}" for text in self._what_is_not_known())])

    def _what_is_not_known(self) -> list[str]:
        """What no number above says, and why: days or wheels are too few, a temperature is not taken out."""
        wheels = self.found.wheels
        texts = []
        short = [wheel.days.wheel for wheel in wheels if not wheel.parameters]
        if short:
            shown = ", ".join(short[:_NAMED]) + (", ..." if len(short) > _NAMED else "")
            texts.append(
                f"no trend, step or limit is known of {len(short)} of {len(wheels)} wheels ({shown}): no parameter is "
                f"known on {LEAST_POINTS} of their days"
            )
        if len(wheels) < LEAST_WHEELS:
            texts.append(f"no wheel is held against its siblings: {LEAST_WHEELS} are needed, and some ten to be sure")
        courses = [trend for wheel in wheels for trend in wheel.parameters.values()]
        cold = sum(trend.fit.per_K is None for trend in courses)
        if cold:
            texts.append(
                f"temperature is taken out of {len(courses) - cold} of {len(courses)} courses: where it is not logged, "
                "or changes by less than 2 K, a season is in the rates"
            )
        return [printable(text) for text in texts]


def _order(wheel: WheelTrend) -> tuple[float, float, str]:
    rates = [abs(trend.relative_rate[0]) for trend in wheel.parameters.values()]
    return -round(concern_of(wheel), 3), -max(rates, default=0.0), wheel.days.wheel


def _wheel(wheel: WheelTrend) -> dict[str, Any]:
    days = wheel.days
    known = days.temperature_degC[np.isfinite(days.temperature_degC)]
    return {
        "wheel": days.wheel,
        "concern": concern_of(wheel),
        "findings": sentences(wheel),
        "logs": len(days),
        "failed": wheel.failed,
        "first_day": days.day[0],
        "last_day": days.day[-1],
        "temperature_degC": [float(known.min()), float(known.max())] if known.size else None,
        "counts": dict(days.counts),
        "nis_mean": float(np.nanmean(days.nis_mean)) if np.isfinite(days.nis_mean).any() else None,
        "not_noise": int(np.count_nonzero(days.not_noise)),
        "parameters": {name: _parameter(wheel, trend) for name, trend in wheel.parameters.items()},
    }


def _parameter(wheel: WheelTrend, trend: ParameterTrend) -> dict[str, Any]:
    fit, left = trend.fit, trend.remaining
    return {
        "unit": STATE_UNITS[trend.parameter],
        "days": int(trend.course.known.rows.size),
        "left_out": [wheel.days.day[row] for row in trend.course.known.far_off],
        "level": fit.level, "level_std": fit.level_std, "level_day": level_day(wheel, trend), "began": fit.began,
        "rate_per_year": fit.rate, "rate_std_per_year": fit.rate_std,
        "rate_95": [fit.rate - _BAND * fit.rate_std, fit.rate + _BAND * fit.rate_std],
        "ages": trend.ages,
        "per_K": fit.per_K, "per_K_std": fit.per_K_std,
        "scatter": fit.scatter, "walk_per_sqrt_year": fit.walk,
        "changes": [
            {"between": list(days_about(wheel, trend, step.before)), "size": step.size, "std": step.std,
             "probability": step.probability}
            for step in fit.steps
        ],
        "siblings": None if trend.shrunk is None else {
            "level": trend.shrunk[0], "level_std": trend.shrunk[1],
            "level_unlike": trend.level_unlike, "rate_unlike": trend.rate_unlike,
        },
        "remaining": None if left is None else {
            "limit": left.limit, "years_05": left.years_05, "years_50": left.years_50, "years_95": left.years_95,
        },
    }  # fmt: skip
