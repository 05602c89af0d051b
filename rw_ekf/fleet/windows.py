"""Which days of a fleet are worth a diagnosis, and why: where an alarm, the residual or a trend calls for one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rw_ekf.filter.consistency import FALSE_ALARM
from rw_ekf.filter.tails import binomial_tail
from rw_ekf.fleet.trend_findings import finding_kinds, rows_about
from rw_ekf.fleet.wheel_trends import WheelTrend

# Chance that a wheel whose residual is noise is looked at for it, over its whole record. A tenth or ten times of it
# moves the required count of days by one: at 365 days it takes four (FALSE_ALARM of each).
_BY_CHANCE = 1e-3
_SAYS = {"ages": "ages", "unlike": "stands out among its siblings"}


@dataclass(frozen=True)
class Window:
    """A day of a log that is to be diagnosed."""

    wheel: str
    day: str
    log: str
    why: str


def windows_of(
    wheels: Sequence[WheelTrend], most: int, can_be: Callable[[Window], bool] = lambda window: True
) -> tuple[list[Window], int]:
    """The windows of a fleet, at most so many, and how many more qualified.

    wheels: the worst first. Each wheel's first window comes before anyone's second. can_be: of what may be diagnosed.
    """
    wanted = [[window for window in _of_wheel(wheel) if can_be(window)] for wheel in wheels]
    by_rank = [found[rank] for rank in range(max(map(len, wanted), default=0)) for found in wanted if rank < len(found)]
    return by_rank[:most], len(by_rank[most:])


def _of_wheel(wheel: WheelTrend) -> Iterator[Window]:
    """What calls for a diagnosis, one window a day, the most telling first."""
    days, taken = wheel.days, set()
    for row, why in _reasons(wheel):
        if row not in taken:
            taken.add(row)
            yield Window(days.wheel, days.day[row], days.log[row], why)


def _reasons(wheel: WheelTrend) -> Iterator[tuple[int, str]]:
    """Rows that gave a result, and why each calls for a diagnosis; one may come more than once."""
    days = wheel.days
    good = np.flatnonzero(days.ok)
    if not good.size:
        return
    steps = [
        (*rows_about(wheel.parameters[name], about.before), name)
        for kind, name, about in finding_kinds(wheel)
        if kind == "changed"
    ]
    steps.sort(key=lambda step: -step[0])  # the newest first
    for _, after, name in steps:
        yield after, f"the first day after a step of {name}"
    standing = [(kind, name) for kind, name, _ in finding_kinds(wheel) if kind in _SAYS]
    for kind, name in standing:
        yield int(good[-1]), f"the newest day: its {name} {_SAYS[kind]}"
    far = [(int(row), name) for name, trend in wheel.parameters.items() for row in trend.course.known.far_off]
    for row, name in sorted(far, key=lambda each: -each[0]):
        yield row, f"{name} is far off the days around it"
    alarmed = np.flatnonzero(days.ok & (np.nan_to_num(days.alarms) > 0.0))
    if alarmed.size:
        yield int(alarmed[-1]), f"the watch raised {int(days.alarms[alarmed[-1]])} alarms on it"
    unlike_noise = np.flatnonzero(days.ok & days.not_noise)
    if unlike_noise.size and binomial_tail(unlike_noise.size, good.size, FALSE_ALARM) < _BY_CHANCE:
        yield int(unlike_noise[-1]), f"its residual is no noise, as on {unlike_noise.size} of {good.size} days"
    for before, _, name in steps:  # what it was like before stands beside it
        yield before, f"the last day before a step of {name}"
    for kind, name in standing:
        if kind == "ages":
            yield int(good[0]), f"the oldest day: its {name} {_SAYS[kind]}"
