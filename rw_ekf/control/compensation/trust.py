"""Whose parameters a compensation on a wheel is given: the filter's while they can be trusted, else the last trusted.

No clock, no line: ticks go in. The set to fall back on is a minute old or more where there is one that old, because a
filter that has diverged did so some time before anybody noticed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from enum import StrEnum
from typing import NamedTuple

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.filter.belief import Belief
from rw_ekf.model.friction import Stribeck
from rw_ekf.records import Estimate, RunState, Tick

_HINDSIGHT_S = 60.0
_LONGEST_STEP_S = 2.0
_KNOWN = 0.5  # a sigma below this share of the value: a number worth using


class Source(StrEnum):
    """Where a compensation's parameters come from."""

    FILTER = "filter"
    LAST_TRUSTED = "last_trusted"
    NOT_NEEDED = "not_needed"  # the scheme takes the motor gain that the run started from, and no more
    NOTHING = "nothing"  # none could be trusted so far


class Trusted(NamedTuple):
    """A source, and what is known from it; None where that is nothing."""

    source: Source
    known: WheelKnown | None


class ParameterTrust:
    """Decides, tick by tick, on the parameters that a scheme uses."""

    def __init__(
        self,
        used: Sequence[str],
        stribeck: Stribeck,
        *,
        start_trusted: bool,
        well: Callable[[Tick], bool] | None = None,
    ) -> None:
        """used: names of the parameters that the scheme uses. start_trusted: the run starts from a trusted set.

        well: whether run and filter are well at a tick; None: as `is_well` says, of a run with a state.
        """
        self._well = is_well if well is None else well
        self._used = tuple(used)
        self._stribeck = stribeck
        self._start_trusted = start_trusted
        self._age_s = 0.0  # of `_newer`
        self._older: Estimate | None = None
        self._newer: Estimate | None = None

    def step(self, tick: Tick, elapsed_s: float) -> Trusted:
        """Weigh one tick, elapsed_s [s] after the one before."""
        estimate = tick.estimate
        self._age_s += min(elapsed_s, _LONGEST_STEP_S)
        if self._well(tick) and self._is_valid(estimate):
            self._keep(estimate)
            source = Source.FILTER if self._used else Source.NOT_NEEDED
            return Trusted(source, WheelKnown.of_estimate(estimate, self._stribeck))
        if self._start_trusted and self._older is None:
            self._keep(estimate)  # the first estimate still has the parameters that the run started from
        self._start_trusted = False
        if self._older is None:
            return Trusted(Source.NOTHING, None)
        known = WheelKnown.of_estimate(self._older, self._stribeck)
        return Trusted(Source.LAST_TRUSTED, replace(known, speed_rad_s=estimate.state.speed_rad_s, estimate=None))

    def _is_valid(self, estimate: Estimate) -> bool:
        return estimate.valid is not None and all(getattr(estimate.valid, name) for name in self._used)

    def _keep(self, estimate: Estimate) -> None:
        if self._older is None or self._newer is None:
            self._older = self._newer = estimate
        elif self._age_s >= _HINDSIGHT_S:
            self._older, self._newer, self._age_s = self._newer, estimate, 0.0


def is_well(tick: Tick) -> bool:
    """Whether run and filter are well at a tick: only then is anything learned from it, or compensated."""
    return tick.state is not None and tick.state.state is RunState.TRACKING and tick.estimate.health is None


def is_trusted_start(start: Belief) -> bool:
    """Whether a model that was learned or given is known well enough to compensate with before the run adds to it."""
    known = zip(start.parameters, start.parameter_std, strict=True)
    return all(std <= _KNOWN * abs(value) for value, std in known)
