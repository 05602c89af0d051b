"""What a diagnosis may cost: work counted where it is done, and what had to be left out for it.

Counted, not timed: a log gets the same verdict on a busy machine as on an idle one. One unit is a nanosecond of an
ordinary core, as the passes over a record cost it (`PASS_UNITS` and so on were measured once); other work goes along
with these. Behind the count stands a clock, of processor time, for a machine that is several times slower: where it
strikes, two runs over one log may end otherwise.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from rw_ekf.wheel.effect_table import ABSENT, EffectTable

# Of a whole diagnosis. Ten minutes at 10 Hz spend a twentieth to a half of it.
MOST_UNITS = 2.0e10
MOST_SECONDS = 180.0

# Shares of the whole that may be spent before a stage is begun, or continued. What comes later is worth more: a verdict
# with fewer rivals compared is a verdict, one that was never judged on the held-out part is none.
SEARCH = 0.5
RIVALS = 0.65
WANDER = 0.85
LAWS = 0.9
FITS = 1.0


# Twice what was measured on one core (20,000 intervals, tests of one effect and of a law of fourteen functions beside
# another), in nanoseconds. An effect that has an own slope by its coefficient is worked out once more for it.
_PASS = 70.0  # an interval without effects
_SLOPES = 20.0  # its slopes
_STATIC = 80.0  # a static effect's contribution, or its slope
_LAW = 100.0  # a learned law's, or a formula's
_FUNCTION = 6.0  # and each function of it
_MEMORY = 260.0  # a flow of friction with a memory
_LAG_STEPS = 4.5  # pieces that a lagging current is followed in
_DELAYED = 2.0  # pieces that an interval falls into where a command comes late
_AVERAGED = 3.0  # and where readings are means over a window
_PHASOR = 10.0  # a sample's phasor turned on by one frequency
_WHITE = 8.0  # a sample of one regressor whitened and projected
_SPANNED = 1.0  # a sample's product of two regressors, as a basis of all of them takes it


def pass_units(intervals: int, table: EffectTable, *, slopes: bool, rows: bool) -> float:
    """Units of one pass of one-step predictions, with slopes by the trajectory, with rows of all slopes.

    Friction with a memory has its slopes by four more flows, and rows by three more than that.
    """
    effects = _STATIC * table.static_at.size + _LAW * table.law_at.size + _FUNCTION * int(table.law_functions.sum())
    if table.memory_at != ABSENT:
        one = (_MEMORY + effects) * (1.0 + 4.0 * slopes) + (3.0 * _MEMORY + 2.0 * effects) * rows
    else:
        one = _PASS + effects + (_SLOPES + effects) * (slopes or rows)
    pieces = _LAG_STEPS if table.lag_at != ABSENT else 1.0
    pieces *= (_DELAYED if table.delay_at != ABSENT else 1.0) * (_AVERAGED if table.window_at != ABSENT else 1.0)
    return intervals * one * pieces


def whitening_units(samples: int, regressors: int) -> float:
    """Units of whitening regressors and a residual, and of the few products that follow."""
    return samples * _WHITE * (regressors + 2.0)


def basis_units(samples: int, regressors: int) -> float:
    """Units of an orthonormal basis of regressors."""
    return _SPANNED * samples * regressors**2


def screening_units(samples: int, frequencies: int) -> float:
    """Units of the power of a series in many frequencies."""
    return _PHASOR * samples * frequencies


def unlimited() -> Work:
    """Work that is counted and never refused."""
    return Work(math.inf, math.inf)


class Work:
    """Counts the work of one diagnosis; stages query it for room, and note what they leave out."""

    def __init__(
        self,
        most_units: float = MOST_UNITS,
        most_seconds: float = MOST_SECONDS,
        clock: Callable[[], float] = time.thread_time,
    ) -> None:
        """The clock starts now."""
        self.units = 0.0
        self.left_out: list[str] = []
        self._most_units = most_units
        self._most_seconds = most_seconds
        self._clock = clock
        self._began_s = clock()

    def charge(self, units: float) -> None:
        """Count work that has been done."""
        self.units += units

    def start_clock(self) -> None:
        """Let the seconds count from now: what came before was reading and compiling."""
        self._began_s = self._clock()

    def has(self, share: float) -> bool:
        """Whether less than that share of the whole is spent, by count and by clock."""
        seconds = self._clock() - self._began_s
        return self.units < share * self._most_units and seconds < share * self._most_seconds

    def leave_out(self, what: str) -> None:
        """Note for the user what was not done; the same thing once."""
        if what not in self.left_out:
            self.left_out.append(what)

    def note(self, other: Work) -> None:
        """Note what another count left out as well."""
        for what in other.left_out:
            self.leave_out(what)

    def sentences(self) -> list[str]:
        """What was left out, for a person; empty where nothing was."""
        if not self.left_out:
            return []
        return [
            f"the diagnosis reached its budget of work and left out: {'; '.join(self.left_out)}. A shorter record, or "
            "one at a lower rate, is looked at in full"
        ]
