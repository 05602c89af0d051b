"""What is wrong with the newest logs of a wheel, of which no course of a parameter shows that it stands on nothing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import BoolArray
from rw_ekf.fleet.daily import WheelDays
from rw_ekf.fleet.points import KNOWS
from rw_ekf.fleet.result_rows import MANY_REJECTED

_NOISY = 2.0  # times the usual innovation of a wheel's days; in simulated fleets a day with spikes reaches 1.4


class Trouble(NamedTuple):
    """Something that holds on each of a wheel's newest days."""

    first: int  # row from which on it does
    text: str


def troubles_of(days: WheelDays) -> list[Trouble]:
    """What holds on the newest days of a wheel, the gravest first."""
    unknown = days.ok & ~np.any([np.isfinite(value) for value in days.values.values()], axis=0)
    moved = np.any([std < KNOWS * np.abs(days.values[name]) for name, std in days.stds.items()], axis=0)
    known = days.innovation_rpm[moved & (days.innovation_rpm > 0.0)]  # at rest a reading on a grid misses nothing
    usual = float(np.quantile(known, 0.25)) if known.size else np.nan  # of a wheel that was good once
    noisy = moved & (days.innovation_rpm > _NOISY * usual)
    found = []
    for holds, text in (
        (days.misread, "its logs are misread: a column has another unit, another sign or is another wheel's"),
        (days.rejected_share > MANY_REJECTED, f"more than {100.0 * MANY_REJECTED:.0f} % of the readings are rejected"),
        (unknown, "the filter was reset, and nothing of these days is in its levels"),
        (noisy, f"the innovations are more than {_NOISY:g} times as large as usual ({usual:.2g} rpm)"),
    ):
        first = _since(holds)
        if first is not None:
            found.append(Trouble(first, text))
    return found


def sentence_of(days: WheelDays, trouble: Trouble) -> str:
    """As it is printed."""
    count = len(days) - trouble.first
    first = days.day[trouble.first]
    which = f"its newest day, {first}" if count == 1 else f"its newest {count} days, since {first}"
    return f"on {which}, {trouble.text}"


def _since(holds: BoolArray) -> int | None:
    """The row from which on it holds to the end; None where it does not on the newest."""
    run = int(np.argmin(np.append(holds[::-1], False)))
    return holds.size - run if run else None
