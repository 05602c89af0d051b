"""Where a course goes beyond what a law without a formula was found over."""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.course.course import Course
from rw_ekf.model.law import Law
from rw_ekf.wheel.effect_table import EffectSet

_BEYOND = 0.02  # of a log, beyond a law's range, above which it is reported
_MARGIN = 0.02  # of its range, by which the same course goes beyond when it is run again: held, it is off by little


class BeyondLaws:
    """How often a log goes beyond what the laws of a model were found over: they stay as they are at the edge."""

    def __init__(self, effects: EffectSet) -> None:
        self._laws = [term.law for term in effects.terms if term.law is not None]
        self._beyond = [0] * len(self._laws)
        self._rows = 0

    def add(self, course: Course, begin: int = 0) -> None:
        """Count the samples of a part from `begin` on."""
        self._rows += course.samples - begin
        for place, law in enumerate(self._laws):
            self._beyond[place] += int(np.count_nonzero(beyond(law, course)[begin:]))

    @property
    def laws(self) -> dict[Law, str]:
        """Those that a good part of the log is beyond, each with the words for it."""
        shares = [count / max(self._rows, 1) for count in self._beyond]
        return {
            law: f"{law.name} is beyond what the learned law was found over ({law.first:.4g} to {law.last:.4g}) in "
            f"{100.0 * share:.0f} % of this log"
            for law, share in zip(self._laws, shares, strict=True)
            if share > _BEYOND
        }

    def sentences(self) -> list[str]:
        """A sentence for each law that a good part of the log is beyond."""
        rest = "the law is held at its edge there, and the estimates may be off; `rw-ekf diagnose LOG` finds it anew"
        return [f"{words}: {rest}" for words in self.laws.values()]


def beyond(law: Law, course: Course) -> BoolArray:
    """Of each sample whether the law stays there as it is at its edge, (n,); never, where that is on purpose."""
    values = _values_of(law, course)
    if values is None:
        return np.zeros(course.samples, dtype=bool)
    room = _MARGIN * (law.last - law.first)
    return (values < law.first - room) | (values > law.last + room)


def _values_of(law: Law, course: Course) -> Float64Array | None:
    """What a law is a function of, along a course; None where it is held on purpose, or comes round again."""
    if law.quantity == "column":
        return course.columns[:, law.slot] if course.columns.size else None
    return {
        "temperature": course.temperature_degC,
        "speed": course.speed_rad_s,
        "speed_size": np.abs(course.speed_rad_s),
    }.get(law.quantity)
