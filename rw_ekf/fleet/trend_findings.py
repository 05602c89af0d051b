"""What of a wheel's trends is worth a word: kinds of findings, how sure they are, and each as a sentence."""

from __future__ import annotations

from typing import Any

import numpy as np

from rw_ekf.fleet.wheel_trends import ParameterTrend, WheelTrend
from rw_ekf.model.state import STATE_UNITS
from rw_ekf.numbers import plus_minus

SURE = 0.99  # that a rate is beyond it
UNLIKE = 0.95  # that a wheel is none of its siblings
SOON_YEARS = 1.0  # a limit that is as likely as not reached within it is worth a word


def concern_of(wheel: WheelTrend) -> float:
    """How much a wheel is worth a look: the largest probability of anything that its findings can be of, 0 to 1."""
    chances = [wheel.failed / max(len(wheel.days), 1)]
    for trend in wheel.parameters.values():
        chances += [max(2.0 * trend.ages - 1.0, 0.0), trend.level_unlike or 0.0, trend.rate_unlike or 0.0]
        chances += [step.probability for step in trend.fit.steps]
        if trend.remaining is not None and trend.remaining.years_50 < SOON_YEARS:
            chances.append(1.0)
    return float(max(chances))


def finding_kinds(wheel: WheelTrend) -> list[tuple[str, str, Any]]:
    """What is found of a wheel, as (kind, parameter, what it is about)."""
    found: list[tuple[str, str, Any]] = []
    for name, trend in wheel.parameters.items():
        if trend.ages > SURE:
            found.append(("ages", name, trend))
        found += [("changed", name, step) for step in trend.fit.steps]
        if max(trend.level_unlike or 0.0, trend.rate_unlike or 0.0) > UNLIKE:
            found.append(("unlike", name, trend))
        if trend.remaining is not None and trend.remaining.years_50 < SOON_YEARS:
            found.append(("limit", name, trend.remaining))
    if wheel.failed:
        found.append(("failed", "", wheel.failed))
    return found


def sentences(wheel: WheelTrend) -> list[str]:
    """The findings of a wheel."""
    return [sentence_of(wheel, *found) for found in finding_kinds(wheel)]


def sentence_of(wheel: WheelTrend, kind: str, name: str, about: Any) -> str:
    """One of `finding_kinds` as a sentence."""
    if kind == "ages":
        rate, std = about.relative_rate
        word = "rises" if rate > 0.0 else "falls"
        return f"{name} {word} by {plus_minus(abs(100.0 * rate), 100.0 * std)} % a year"
    if kind == "changed":
        share = 100.0 / abs(wheel.parameters[name].fit.began)
        where = " and ".join(days_about(wheel, wheel.parameters[name], about.before))
        return f"{name} stepped by {plus_minus(share * about.size, share * about.std)} % between {where}"
    if kind == "unlike":
        level = about.level_unlike >= about.rate_unlike
        what = "is unlike its siblings'" if level else "changes unlike its siblings'"
        return f"{name} {what} (probability {max(about.level_unlike, about.rate_unlike):.3g})"
    if kind == "limit":
        until = (
            "has reached" if about.years_50 == 0.0 else f"reaches in {about.years_05:.2g} to {about.years_95:.2g} years"
        )
        return f"{name} {until} its limit of {about.limit:.4g} {STATE_UNITS[name]}"
    return f"{about} of its {len(wheel.days)} logs failed{_since(wheel)}"


def _since(wheel: WheelTrend) -> str:
    """From when on nothing is known of a wheel whose newest logs failed; nothing where the newest has a result."""
    known = np.flatnonzero(wheel.days.ok)
    if known.size == 0 or known[-1] == len(wheel.days) - 1:
        return ""
    return f", the newest among them: what is told of it is of {wheel.days.day[known[-1]]} at the latest"


def level_day(wheel: WheelTrend, trend: ParameterTrend) -> str:
    """The day that a parameter's level is of, and from which its remaining time counts: the last that knows it."""
    return wheel.days.day[int(trend.course.known.rows[-1])]


def rows_about(trend: ParameterTrend, before: int) -> tuple[int, int]:
    """The wheel's rows on either side of a step: the last before it, the first after it. before: `Step.before`."""
    after = int(trend.course.starts[before + 1])
    rows = trend.course.known.rows
    return int(rows[np.searchsorted(rows, after) - 1]), after


def days_about(wheel: WheelTrend, trend: ParameterTrend, before: int) -> tuple[str, str]:
    """The days of `rows_about`."""
    last, first = rows_about(trend, before)
    return wheel.days.day[last], wheel.days.day[first]
