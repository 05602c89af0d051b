"""Commands that nothing acknowledges: telemetry behind one bears it out, or says that another current is in force."""

from __future__ import annotations

import math

from rw_ekf.driver import OPPOSITE

NOT_TAKEN, TAKEN_OPPOSITE = 1, 2  # statuses of a write that telemetry does not bear out, or with the other sign
STATUSES = {0: "ok", NOT_TAKEN: "not_taken", TAKEN_OPPOSITE: OPPOSITE}
_AGAIN_AFTER, _NOT_TAKEN_AFTER = 2, 4  # readings that say another current is in force
_AGAINST_S = 0.5


class Bearing:
    """One command, held against the currents that are reported behind it."""

    def __init__(self, wanted_A: float, before_A: float, may_A: float) -> None:
        """before_A: the command before it. may_A: by how much a current in force may differ as reported [A]."""
        self._wanted_A, self._before_A, self._may_A = wanted_A, before_A, may_A
        self._against = self._opposite = 0

    def is_borne_out(self, reported_A: float) -> bool:
        """Whether a reported current is the one commanded; one that is not counts against it."""
        if abs(reported_A - self._wanted_A) <= self._may_A:
            return True
        self._against += 1
        self._opposite += abs(reported_A + self._wanted_A) <= self._may_A < abs(reported_A - self._before_A)
        return False

    @property
    def is_due_again(self) -> bool:
        """Whether it is time to send it once more."""
        return self._against == _AGAIN_AFTER

    @property
    def is_refused(self) -> bool:
        """Whether nothing more is to be expected."""
        return self._against >= _NOT_TAKEN_AFTER

    @property
    def status(self) -> int | None:
        """Of a command that was not borne out; None where too little was reported."""
        if self._against <= _AGAIN_AFTER:
            return None
        return TAKEN_OPPOSITE if self._opposite > _AGAIN_AFTER else NOT_TAKEN


class Standing:
    """For how long no command has been borne out."""

    def __init__(self) -> None:
        self._since_s: float | None = None

    def note_taken(self) -> None:
        """One was."""
        self._since_s = None

    def note_against(self, now_s: float) -> tuple[str, str] | None:
        """Another one was not: an event and its sentence, once, when that persists."""
        if self._since_s is None:
            self._since_s = now_s
        if now_s - self._since_s <= _AGAINST_S:
            return None
        self._since_s = math.inf
        return (
            "commands_not_taken",
            "telemetry goes on saying that another current is in force than the one commanded: the wheel refuses "
            "commands or does not hear them, something else commands it, or its telemetry stands still",
        )
