"""What a compensation may add to the current of the request alone: bounded, faded in, gone at once, silent at rest."""

from __future__ import annotations

import math

_LONGEST_STEP_S = 1.0  # a gap does not fade anything in
_QUIET_SHARE = 0.05  # of the break-away current: a smaller request asks for nothing that a standing wheel should do


class BoundedCurrent:
    """The compensation's own current: within +-limit_A, times a share that grows from 0 to 1 within fade_s.

    `off` takes effect at once; after it the share begins at 0 again.
    """

    def __init__(self, limit_A: float, fade_s: float) -> None:
        self._limit_A = limit_A
        self._fade_s = fade_s
        self.share = 0.0

    def step(self, wanted_A: float, elapsed_s: float) -> float:
        """The current [A] that may be added now, elapsed_s [s] after the turn before; 0 for what is no number."""
        step_s = min(max(elapsed_s, 0.0), _LONGEST_STEP_S)
        self.share = min(1.0, self.share + step_s / self._fade_s) if self._fade_s > 0.0 else 1.0
        if not math.isfinite(wanted_A):
            return 0.0
        return self.share * max(-self._limit_A, min(self._limit_A, wanted_A))

    def off(self) -> None:
        """Add nothing from now on."""
        self.share = 0.0


def moving_share(speed_rad_s: float, slow_rad_s: float, request_A: float, breakaway_A: float) -> float:
    """How much of a compensation acts on a slow wheel, 0 to 1: all of it where it turns, or is asked to.

    Below slow_rad_s (the Stribeck speed) friction falls with speed, and which way the wheel turns is a matter of noise:
    a compensation that overdoes it a little there drives the wheel by itself, to and fro. So a wheel that nothing is
    asked of is left to its friction, which stops and holds it. From one to two times slow_rad_s the share grows to 1;
    so it does with the request, up to 5 % of the break-away current.
    """
    turns = min(max(abs(speed_rad_s) / slow_rad_s - 1.0, 0.0), 1.0)
    quiet_A = _QUIET_SHARE * abs(breakaway_A)
    asked = 1.0 if abs(request_A) >= quiet_A else abs(request_A) / quiet_A
    return max(turns, asked if request_A != 0.0 else 0.0)
