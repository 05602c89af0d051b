"""The health of an online filter: examined after every sample, reset where it is broken, reported in sentences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rw_ekf.filter import health
from rw_ekf.filter.step import LEARNS, RESET, Sample
from rw_ekf.records import FilterHealth, FilterReset, FilterTrouble

if TYPE_CHECKING:
    from rw_ekf.filter.ekf import WheelEkf  # with filterpy, which takes a second to import

TROUBLES = {
    health.NOT_FINITE: FilterTrouble.NOT_FINITE,
    health.NOT_POSITIVE: FilterTrouble.NOT_POSITIVE,
    health.RAN_AWAY: FilterTrouble.RAN_AWAY,
    health.DIVERGED: FilterTrouble.DIVERGED,
    health.LOCKED_OUT: FilterTrouble.LOCKED_OUT,
    health.UNPHYSICAL: FilterTrouble.UNPHYSICAL,
}
_RESETS = {
    health.NOTHING: FilterReset.NOTHING,
    health.SPEED_ONLY: FilterReset.SPEED,
    health.PARAMETERS_WIDENED: FilterReset.PARAMETERS,
    health.ALL_AFRESH: FilterReset.ALL,
}
_STATED = {
    FilterTrouble.NOT_FINITE: "the filter's state was no longer a number",
    FilterTrouble.NOT_POSITIVE: "the filter's covariance was no longer positive",
    FilterTrouble.RAN_AWAY: "the filter's state had run away to where no wheel is",
    FilterTrouble.DIVERGED: (
        "the readings kept missing the filter's predictions on one side: the wheel has changed, or does what the model "
        "does not know"
    ),
    FilterTrouble.LOCKED_OUT: "every reading was refused for long",
    FilterTrouble.UNPHYSICAL: (
        "the motor gain or the Coulomb friction is negative by five sigma: a sign in the wire map is wrong, or the "
        "readings are not the wheel's"
    ),
}
_DONE = {
    FilterReset.NOTHING: "nothing was reset",
    FilterReset.SPEED: "the speed was taken from the reading",
    FilterReset.PARAMETERS: "the last good parameters were taken with wider sigmas",
    FilterReset.ALL: "everything began again from the start",
}


class Physician:
    """Keeps one filter's history of resets."""

    def __init__(self, ekf: WheelEkf) -> None:
        self._ekf = ekf
        self._memory = ekf.memory.health
        self._last: FilterHealth | None = None
        self.troubles: Counter[FilterTrouble] = Counter()  # that led to a reset

    def examine(self, sample: Sample, time_s: float, what: int) -> bool:
        """Reset what is broken after a sample of outcome `what`; True where anything was.

        Raises FilterError on a broken belief that has nothing to be reset to, because it held everything for known.
        """
        verdict = self._ekf.look_after(sample, what)
        now = self._ekf.memory.now
        if now[LEARNS] == 0.0:
            self._ekf.check()
        elif verdict == health.WELL:
            self._last = self._still_wrong(time_s)
        else:
            trouble = TROUBLES[verdict]
            self.troubles[trouble] += 1
            self._last = self._found(trouble, _RESETS[int(now[RESET])], time_s)
        return verdict != health.WELL

    @property
    def has_forgotten(self) -> bool:
        """Whether the last reset took the parameters."""
        return self._last is not None and self._last.reset in (FilterReset.PARAMETERS, FilterReset.ALL)

    @property
    def health(self) -> FilterHealth | None:
        """At the last sample; None where all is well."""
        return self._last

    def _still_wrong(self, time_s: float) -> FilterHealth | None:
        memory, last = self._memory, self._last
        if health.is_recovering(memory):
            return last
        trouble = TROUBLES.get(health.still_wrong(memory, self._ekf.x, self._ekf.P))
        if trouble is None or (last is not None and last.trouble is trouble):
            return None if trouble is None else last
        return self._found(trouble, FilterReset.NOTHING, time_s)

    def _found(self, trouble: FilterTrouble, reset: FilterReset, time_s: float) -> FilterHealth:
        hopeless = health.is_beyond_mending(self._memory)
        text = f"{_STATED[trouble]}; {_DONE[reset]}"
        if hopeless:
            text += ", again and again: only a person can help"
        return FilterHealth(trouble, reset, text, time_s, hopeless)


def troubles_of(mended: NDArray[np.int8]) -> list[FilterTrouble]:
    """What led to the resets of a run (`FilterRun.mended`), in order."""
    return [TROUBLES[int(code)] for code in mended[mended != health.WELL]]


def findings(troubles: Iterable[FilterTrouble]) -> list[str]:
    """What a run has to say of the resets of its filter, a sentence for each trouble."""
    return [
        f"{_STATED[trouble]}; the filter was reset ({times} time{'s' if times > 1 else ''})"
        for trouble, times in Counter(troubles).items()
    ]
