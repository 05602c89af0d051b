"""What a run is doing, in one word: a small machine with hysteresis and one latch.

    CONNECTING -> TRACKING -> DEGRADED -> TRACKING     by how many turns running brought a reading that was used
    any -> LOST -> CONNECTING                          the line is down or silent; it answers again
    any -> SAFE                                        latched: only `resume` leads out, and only without the danger

No clock but for the hour of a change; nothing is written to a wheel here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rw_ekf.clock import Clock
from rw_ekf.logs.metadata import utc_text
from rw_ekf.records import LinkState, RunState, StateNow

Note = Callable[..., None]

_CONNECTED_AFTER = 3  # used readings running
_DEGRADED_AFTER = 2  # turns running without one
_WELL_AFTER = 5
_FORGET = 0.1  # weight of a turn in the running share of bad ones
_BAD_SHARE = 0.5
_GOOD_SHARE = 0.2
_DOWN = (LinkState.SILENT, LinkState.DOWN)


@dataclass(frozen=True, slots=True)
class Turn:
    """What one turn of the loop says of the run."""

    link: LinkState
    used: bool  # a reading came and the filter took it
    trouble: str | None = None  # what is wrong although readings are used
    danger: str | None = None  # why the wheel must not be driven


class RunStates:
    """The state of one run; every change is reported with its reason."""

    def __init__(self, clock: Clock, note: Note, *, latches: bool = True) -> None:
        """latches: whether there is a SAFE: a run that never writes has nothing to hold back; its danger is trouble."""
        self._clock = clock
        self._note = note
        self._latches = latches
        self._good = self._bad = 0  # turns running
        self._bad_share = 0.0
        self._resume_wanted = False
        self.forbidden: str | None = None  # why it must not be driven for the rest of the run, whoever says what
        self._began = clock.utc()
        self.now = StateNow(RunState.CONNECTING, utc_text(self._began), "the line has been opened")

    @property
    def is_safe(self) -> bool:
        """Whether nothing but zero may be written."""
        return self.now.state is RunState.SAFE

    def step(self, turn: Turn) -> StateNow:
        """Take one turn."""
        self._count(turn)
        danger = self.forbidden or turn.danger
        if self.is_safe:
            self._leave_safe(danger)
        elif danger is not None and self._latches:
            self._go(RunState.SAFE, danger)
        else:
            self._follow(turn, turn.trouble or danger)
        self._resume_wanted = False
        return self.now

    def latch(self, danger: str, *, for_good: bool = False) -> None:
        """Go to SAFE for something seen outside a turn. for_good: no word of a person undoes it during this run."""
        if not self._latches:
            return
        if for_good:
            self.forbidden = self.forbidden or danger
        if not self.is_safe:
            self._go(RunState.SAFE, danger)

    def resume(self) -> None:
        """A person says that the wheel may be driven again; heard at the next turn."""
        self._resume_wanted = True

    def _count(self, turn: Turn) -> None:
        good = turn.used and turn.link is LinkState.ANSWERED and turn.trouble is None and turn.danger is None
        self._good = self._good + 1 if good else 0
        self._bad = 0 if good else self._bad + 1
        self._bad_share += _FORGET * ((not good) - self._bad_share)

    def _leave_safe(self, danger: str | None) -> None:
        if not self._resume_wanted:
            return
        if danger is None:
            self._good = 0
            self._go(RunState.CONNECTING, "resumed by a person")
        else:
            self._note("not_resumed", reason=danger)

    def _follow(self, turn: Turn, trouble: str | None) -> None:
        state = self.now.state
        if turn.link in _DOWN:
            if state is not RunState.LOST:
                why = "the port has failed" if turn.link is LinkState.DOWN else "no telemetry for limits.silence_s"
                self._go(RunState.LOST, why)
        elif state is RunState.LOST:
            if turn.link is LinkState.ANSWERED:
                self._good = int(turn.used)
                self._go(RunState.CONNECTING, "the wheel answers again")
        elif state is RunState.CONNECTING:
            if self._good >= _CONNECTED_AFTER:
                self._bad_share = 0.0
                self._go(RunState.TRACKING, "readings come and are used")
        elif state is RunState.TRACKING:
            short = trouble or self._shortage()
            if short is not None:
                self._go(RunState.DEGRADED, short)
        elif trouble is None and self._good >= _WELL_AFTER and self._bad_share < _GOOD_SHARE:
            self._go(RunState.TRACKING, "readings come and are used again")

    def _shortage(self) -> str | None:
        if self._bad >= _DEGRADED_AFTER:
            return f"{self._bad} turns running without a reading that could be used"
        if self._bad_share > _BAD_SHARE:
            return "more than half of the latest turns without a reading that could be used"
        return None

    def _go(self, state: RunState, reason: str) -> None:
        now = self._clock.utc()
        was, self.now = self.now.state, StateNow(state, utc_text(now), reason)
        since_start_s = round((now - self._began).total_seconds(), 1)
        self._note("state", state=state.value, was=was.value, since_start_s=since_start_s, reason=reason)
