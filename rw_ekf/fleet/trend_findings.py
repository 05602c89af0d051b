"""What of a wheel's trends is worth a word: kinds of findings, how sure they are, and each as a sentence."""

from __future__ import annotations

from typing import Any

import numpy as np

from rw_ekf.fleet import log_troubles
from rw_ekf.fleet.remaining import Remaining
from rw_ekf.fleet.wheel_trends import ParameterTrend, WheelTrend
from rw_ekf.model.state import STATE_UNITS
from rw_ekf.numbers import plus_minus

SURE = 0.99  # that a rate is beyond it
UNLIKE = 0.95  # that a wheel is none of its siblings
SOON_YEARS = 1.0  # a limit that is as likely as not reached within it is worth a word, if anything goes towards it


def concern_of(wheel: WheelTrend) -> float:
    """How much a wheel is worth a look: the largest probability of anything that its findings can be of, 0 to 1."""
    chances = [wheel.failed / max(len(wheel.days), 1), float(bool(log_troubles.troubles_of(wheel.days)))]
    for trend in wheel.parameters.values():
        chances += [max(2.0 * trend.ages - 1.0, 0.0), trend.level_unlike or 0.0, trend.rate_unlike or 0.0]
        chances += [step.probability for step in trend.fit.steps]
        chances.append(float(_reaches_soon(trend) or _newest_is_off(wheel, trend)))
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
        if _newest_is_off(wheel, trend):
            found.append(("newest", name, trend))
        if _reaches_soon(trend):
            found.append(("limit", name, trend.remaining))
    found += [("logs", "", trouble) for trouble in log_troubles.troubles_of(wheel.days)]
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
    if kind == "newest":
        known = about.course.known
        day, by = wheel.days.day[int(known.far_off[-1])], 100.0 * known.far_by[-1]
        return f"{name} was {by:+.3g} % off on {day}: one day, which its course leaves out until another is like it"
    if kind == "logs":
        return log_troubles.sentence_of(wheel.days, about)
    if kind == "limit":
        return f"{name} {_until(about)} its limit of {about.limit:.4g} {STATE_UNITS[name]}"
    return f"{about} of its {len(wheel.days)} logs failed{_since(wheel)}"


def _newest_is_off(wheel: WheelTrend, trend: ParameterTrend) -> bool:
    """Whether the newest of the days that know a parameter is far off those before it."""
    known = trend.course.known
    return known.far_off.size > 0 and known.far_off[-1] > known.rows[-1]


def _reaches_soon(trend: ParameterTrend) -> bool:
    """Whether a limit is reached, or as likely as not will be soon, by a course that surely goes there.

    Of a few days nothing is known of a rate, and half of all rates that are possible lead to any limit at once.
    """
    left = trend.remaining
    if left is None or left.years_50 >= SOON_YEARS:
        return False
    return left.years_50 == 0.0 or left.towards > SURE


def _until(left: Remaining) -> str:
    if left.years_50 == 0.0:
        return "has reached"
    if left.years_95 == float("inf"):
        return f"reaches in {left.years_05:.2g} years or later, or never,"
    return f"reaches in {left.years_05:.2g} to {left.years_95:.2g} years"


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
