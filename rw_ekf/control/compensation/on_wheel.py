"""A compensation on a real wheel: a controller that adds it to the current of the request, as far as it is trusted."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.scheme import Compensation, Request
from rw_ekf.control.compensation.schemes import SchemeEntry, WheelSheet
from rw_ekf.control.compensation.tick_intervals import Elapsed
from rw_ekf.control.compensation.trust import ParameterTrust, Source, is_well
from rw_ekf.records import CompensationNow, RunState, StateNow, Tick

_STATED = {
    Source.FILTER: "with the filter's parameters",
    Source.LAST_TRUSTED: "with the last parameters that could be trusted: the filter's cannot now",
    Source.NOT_NEEDED: "without estimated parameters: the scheme needs none",
    Source.NOTHING: "no parameters that can be trusted are known yet",
}
_NO_NUMBER = "the scheme gives no number: nothing is added"
_LONGEST_STEP_S = 1.0  # a gap does not fade anything in
_QUIET_SHARE = 0.05  # of the break-away current: a smaller request demands nothing that a standing wheel should do


@dataclass(frozen=True)
class Terms:
    """On what terms a compensation acts, apart from the request."""

    limit_A: float
    fade_s: float
    forbidden: Callable[[], str | None] = lambda: None  # why it may not, beyond what ticks say
    note: Callable[..., None] = lambda event, **context: None  # takes each change as a named event


class WheelCompensator:
    """The current of the request alone, a / k of the sheet, and what a scheme adds to it while all is well.

    Off at once in every state but TRACKING and where the filter is not well; then begun anew, with a scheme that
    remembers nothing, and faded in. The guard behind it is the only writer.
    """

    def __init__(
        self, entry: SchemeEntry, sheet: WheelSheet, request: Request, trust: ParameterTrust, terms: Terms
    ) -> None:
        """sheet: what is known of the wheel when the run starts; its motor gain is not zero."""
        self._entry = entry
        self._sheet = sheet
        self._request = request
        self._trust = trust
        self._terms = terms
        self._elapsed = Elapsed()
        self._bounded = BoundedCurrent(terms.limit_A, terms.fade_s)
        self._breakaway_A = sheet.parameters.static / sheet.parameters.motor_gain
        self._scheme: Compensation | None = None  # None: off
        self._now = CompensationNow(entry.id, False, Source.NOTHING, 0.0, 0.0, "nothing has been asked for yet")
        self._reported = self._now

    def __call__(self, tick: Tick) -> float:
        """Return the current [A] to request after this tick's sample."""
        request = self._request(tick)
        plain_A = request / self._sheet.parameters.motor_gain
        elapsed_s = self._elapsed.step(tick)
        source, known = self._trust.step(tick, elapsed_s)
        why_not = self._terms.forbidden() if is_well(tick) else _trouble(tick.state, tick)
        if why_not is not None:
            self._off(why_not, self._now.parameters)
            return plain_A
        if known is None:
            self._off(_STATED[source], source)
            return plain_A
        wanted_A = self._wanted_A(tick, request, known) - plain_A
        added_A = self._bounded.step(wanted_A, elapsed_s)
        slow = self._sheet.stribeck.omega_s
        added_A *= moving_share(known.speed_rad_s, slow, plain_A, self._breakaway_A)
        reason = _STATED[source] if math.isfinite(wanted_A) else _NO_NUMBER
        self._now = CompensationNow(self._entry.id, True, source, self._bounded.share, added_A, reason)
        return plain_A + added_A

    def compensating(self, state: StateNow | None) -> CompensationNow:
        """What it does after a turn in this state; the turn may have requested no current, and ends it all the same."""
        if state is not None and state.state is not RunState.TRACKING:
            self._off(_trouble(state), self._now.parameters)
        now, reported = self._now, self._reported
        if (now.on, now.parameters, now.reason) != (reported.on, reported.parameters, reported.reason):
            self._reported = now
            self._terms.note(
                "compensation", scheme=now.scheme, on=now.on, parameters=str(now.parameters), reason=now.reason
            )
        return now

    def _wanted_A(self, tick: Tick, request: float, known: WheelKnown) -> float:
        """The scheme's current [A]; NaN where it cannot say."""
        if self._scheme is None:
            self._scheme = self._entry.make(self._sheet)
        try:
            return self._scheme.current_A(tick, request, known)
        except (ArithmeticError, ValueError):  # a division by a gain of zero, the exponential of too much
            return math.nan

    def _off(self, reason: str, parameters: str) -> None:
        self._scheme = None
        self._bounded.off()
        self._now = CompensationNow(self._entry.id, False, parameters, 0.0, 0.0, reason)


def _trouble(state: StateNow | None, tick: Tick | None = None) -> str:
    """Why nothing is compensated at a tick that is not well."""
    if tick is not None and tick.estimate.health is not None:
        return f"the filter is not well: {tick.estimate.health.text}"
    return "the run has no state" if state is None else f"{state.state.value}: {state.reason}"


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
    """How much of a compensation acts on a slow wheel, 0 to 1: all of it where it turns, or is commanded to.

    Below slow_rad_s (the Stribeck speed) friction falls with speed, and which way the wheel turns is a matter of noise:
    a compensation that overdoes it a little there drives the wheel by itself, to and fro. So a wheel that
    gets no request is left to its friction, which stops and holds it. From one to two times slow_rad_s the share grows
    to 1; so it does with the request, up to 5 % of the break-away current.
    """
    turns = min(max(abs(speed_rad_s) / slow_rad_s - 1.0, 0.0), 1.0)
    quiet_A = _QUIET_SHARE * abs(breakaway_A)
    wanted = 1.0 if abs(request_A) >= quiet_A else abs(request_A) / quiet_A
    return max(turns, wanted if request_A != 0.0 else 0.0)
